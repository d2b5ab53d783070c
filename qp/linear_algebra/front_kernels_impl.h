// Body of the kernels for one vector width. Included by front_kernels_<isa>.cpp, which define ISLET_NUMBER (its type), ISLET_BITS and
// ISLET_LANES (bits and numbers of a vector), ISLET_TILE (vectors in a tile of rows) and ISLET_KERNEL_SET (the name of the set). Nothing but builtins and
// intrinsics is used here: an inline function of a shared header, compiled with wider vectors, could be chosen by the linker for
// everyone. (Those of front_kernels.h are integer arithmetic on constants, the same for all.)
//
// N is the number of columns handled together: the block size, at most 6. Every kernel works on whole vectors: what lies
// above the diagonal and below the last row is scratch, so there are no remainder loops. Each number is made by the same
// operations in the same order however the lines are split.
#include "qp/linear_algebra/front_factorise_impl.h"
#include "qp/linear_algebra/front_solve_impl.h"
#include "qp/linear_algebra/front_vectors_impl.h"

namespace islet::qp {
namespace {

// to += from, `count` numbers.
ISLET_INLINE void AddLine(const Number* from, int count, Number* to) {
  int r = 0;
  for (; r + kLanes <= count; r += kLanes) Store(to + r, Load(to + r) + Load(from + r));
#if ISLET_BITS == 512
  if (r == count) return;
  const unsigned rest = (1u << (count - r)) - 1;
  if constexpr (sizeof(Number) == 8) {
    const auto mask = static_cast<__mmask8>(rest);
    const __m512d sum = _mm512_add_pd(_mm512_maskz_loadu_pd(mask, to + r), _mm512_maskz_loadu_pd(mask, from + r));
    _mm512_mask_storeu_pd(to + r, mask, sum);
  } else {
    const auto mask = static_cast<__mmask16>(rest);
    const __m512 sum = _mm512_add_ps(_mm512_maskz_loadu_ps(mask, to + r), _mm512_maskz_loadu_ps(mask, from + r));
    _mm512_mask_storeu_ps(to + r, mask, sum);
  }
#else
  for (; r + 2 <= count; r += 2) *reinterpret_cast<PairAt*>(to + r) += *reinterpret_cast<const PairAt*>(from + r);
  if (r < count) to[r] += from[r];
#endif
}

template <int N>
void ExtendAdd(const ThisFront& parent, int m, const int* to, const Number* child, int begin, int end) {
  const int block = N == 3 ? 3 : parent.block, child_stride = ThisFront::OddStride(m * block),
            columns = parent.k / block;
  for (int j = begin; j < end; ++j) {
    const bool in_panel = to[j] < columns;
    const int stride = in_panel ? parent.panel_stride : parent.update_stride;
    Number* out = in_panel ? parent.panel + parent.lead + to[j] * block * stride
                           : parent.update + (to[j] - columns) * block * stride - parent.k;
    const Number* in = child + j * block * child_stride;
    for (int i = j; i < m;) {  // runs of neighbouring rows
      int run = 1;
      while (i + run < m && to[i + run] == to[i] + run) ++run;
      const Number* a = in + i * block;
      Number* b = out + to[i] * block;
      const int rows = run * block;
      for (int q = 0; q < block; ++q, a += child_stride, b += stride) AddLine(a, rows, b);
      i += run;
    }
  }
}

void AddProducts(int count, const ContactProduct* products, const Number* rows, const Number* d, Number sign,
                 Number* out, int stride) {
  constexpr int kParts = ThisFront::kVector / kLanes;  // vectors in a padded row of J
  Number sum[6][ThisFront::kVector] = {};
  for (int part = 0; part < kParts; ++part) {
    if (part * kLanes >= 6) continue;
    Vec columns[6] = {};
    for (const ContactProduct* c = products; c != products + count; ++c) {
      const Number* left = rows + c->left * 3 * ThisFront::kVector + part * kLanes;
      const Number* right = rows + c->right * 3 * ThisFront::kVector;
      const Number* inner = d + c->contact * 9;
      const Vec l0 = Load(left), l1 = Load(left + ThisFront::kVector), l2 = Load(left + 2 * ThisFront::kVector);
      for (int q = 0; q < 3; ++q) {
        const Vec scaled = l0 * inner[3 * q] + l1 * inner[3 * q + 1] + l2 * inner[3 * q + 2];
        for (int j = 0; j < 6; ++j) columns[j] += scaled * right[q * ThisFront::kVector + j];
      }
    }
    for (int j = 0; j < 6; ++j) Store(&sum[j][part * kLanes], columns[j]);
  }
  for (int j = 0; j < 6; ++j)
    for (int i = 0; i < 6; ++i) out[i + j * stride] += sign * sum[j][i];
}

template <int N>
constexpr FrontKernelsOf<Number> kKernelsFor = {
    &FactoriseFront<N>, &Eliminate<N>,    &SolveLines<N>,   &UpdateLines<N>,     &ExtendAdd<N>,     &ForwardFront<N>,
    &BackwardFront<N>,  &ForwardBlock<N>, &ForwardLines<N>, &BackwardColumns<N>, &BackwardBlock<N>, &AddProducts};

}  // namespace

extern const FrontKernelSetOf<Number> ISLET_KERNEL_SET;
const FrontKernelSetOf<Number> ISLET_KERNEL_SET = {ISLET_KERNEL_NAME, &kKernelsFor<1>, &kKernelsFor<3>,
                                                   &kKernelsFor<6>};

}  // namespace islet::qp
