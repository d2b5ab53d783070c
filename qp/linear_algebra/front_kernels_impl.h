// Body of the kernels for one vector width. Included by front_kernels_<isa>.cpp, which define ISLET_LANES (doubles in a
// vector), ISLET_TILE (vectors in a tile of rows) and ISLET_KERNEL_SET (the name of the set). Nothing but builtins and
// intrinsics is used here: an inline function of a shared header, compiled with wider vectors, could be chosen by the linker for
// everyone. (Those of front_kernels.h are integer arithmetic on constants, the same for all.)
//
// A group of kColumns is handled together. Every kernel works on whole vectors: what lies
// above the diagonal and below the last row is scratch, so there are no remainder loops. Each number is made by the same
// operations in the same order however the lines are split.
#include "qp/linear_algebra/front_factorise_impl.h"
#include "qp/linear_algebra/front_solve_impl.h"
#include "qp/linear_algebra/front_vectors_impl.h"

namespace islet::qp {
namespace {

// to += from, `count` numbers.
ISLET_INLINE void AddLine(const double* from, int count, double* to) {
  int r = 0;
  for (; r + kLanes <= count; r += kLanes) Store(to + r, Load(to + r) + Load(from + r));
#if ISLET_LANES == 8
  if (r == count) return;
  const auto mask = static_cast<__mmask8>((1u << (count - r)) - 1);
  const __m512d sum = _mm512_add_pd(_mm512_maskz_loadu_pd(mask, to + r), _mm512_maskz_loadu_pd(mask, from + r));
  _mm512_mask_storeu_pd(to + r, mask, sum);
#else
  for (; r + 2 <= count; r += 2) *reinterpret_cast<PairAt*>(to + r) += *reinterpret_cast<const PairAt*>(from + r);
  if (r < count) to[r] += from[r];
#endif
}

void ExtendAdd(const Front& parent, int m, const int* to, const double* child, int begin, int end) {
  const int block = parent.block, columns = parent.k / block;
  const ptrdiff_t child_stride = OddStride(m * block);
  for (int j = begin; j < end; ++j) {
    const bool in_panel = to[j] < columns;
    const ptrdiff_t stride = in_panel ? parent.panel_stride : parent.update_stride;
    double* out = in_panel ? parent.panel + parent.lead + to[j] * block * stride
                           : parent.update + (to[j] - columns) * block * stride - parent.k;
    const double* in = child + j * block * child_stride;
    for (int i = j; i < m;) {  // runs of neighbouring rows
      int run = 1;
      while (i + run < m && to[i + run] == to[i] + run) ++run;
      const double* a = in + i * block;
      double* b = out + to[i] * block;
      const int rows = run * block;
      for (int q = 0; q < block; ++q, a += child_stride, b += stride) AddLine(a, rows, b);
      i += run;
    }
  }
}

void AddProducts(int count, const ContactProduct* products, const double* rows, const double* d, double sign,
                 double* out, int stride) {
  constexpr int kParts = kVector / kLanes;  // vectors in a padded row of J
  double sum[6][kVector] = {};
  for (int part = 0; part < kParts; ++part) {
    if (part * kLanes >= 6) continue;
    Vec columns[6] = {};
    for (const ContactProduct* c = products; c != products + count; ++c) {
      const double* left = rows + c->left * 3 * kVector + part * kLanes;
      const double* right = rows + c->right * 3 * kVector;
      const double* inner = d + c->contact * 9;
      const Vec l0 = Load(left), l1 = Load(left + kVector), l2 = Load(left + 2 * kVector);
      for (int q = 0; q < 3; ++q) {
        const Vec scaled = l0 * inner[3 * q] + l1 * inner[3 * q + 1] + l2 * inner[3 * q + 2];
        for (int j = 0; j < 6; ++j) columns[j] += scaled * right[q * kVector + j];
      }
    }
    for (int j = 0; j < 6; ++j) Store(&sum[j][part * kLanes], columns[j]);
  }
  for (int j = 0; j < 6; ++j)
    for (int i = 0; i < 6; ++i) out[i + j * stride] += sign * sum[j][i];
}

}  // namespace

extern const FrontKernels ISLET_KERNEL_SET;
const FrontKernels ISLET_KERNEL_SET = {&FactoriseFront, &Eliminate,       &SolveLines,    &UpdateLines,
                                       &ExtendAdd,      &ForwardFront,    &BackwardFront, &ForwardBlock,
                                       &ForwardLines,   &BackwardColumns, &BackwardBlock, &AddProducts};

}  // namespace islet::qp
