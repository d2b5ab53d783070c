// Body of the kernels for one vector width. Included by front_kernels_<isa>.cpp, which define ISLET_LANES (doubles in a
// vector), ISLET_TILE (vectors in a tile of rows) and ISLET_KERNEL_SET (the name of the set). Nothing but builtins and
// intrinsics is used here: an inline function of a shared header, compiled with wider vectors, could be chosen by the linker for
// everyone. (Those of front_kernels.h are integer arithmetic on constants, the same for all.)
//
// N is the number of columns handled together: the block size, at most 6. Every kernel works on whole vectors: what lies
// above the diagonal and below the last row is scratch, so there are no remainder loops. Each number is made by the same
// operations in the same order however the lines are split.
#if ISLET_LANES > 2
#include <immintrin.h>
#endif

#include "qp/front_kernels.h"

namespace islet::qp {
namespace {

constexpr int kLanes = ISLET_LANES;
constexpr int kTile = ISLET_TILE;
typedef double Vec __attribute__((vector_size(ISLET_LANES * sizeof(double)), may_alias));

// In memory, at any double. Only behind pointers: as the type of a template's argument it would lose its alignment.
typedef double VecAt __attribute__((vector_size(ISLET_LANES * sizeof(double)), aligned(sizeof(double)), may_alias));
typedef double PairAt __attribute__((vector_size(2 * sizeof(double)), aligned(sizeof(double)), may_alias));

#define ISLET_INLINE inline __attribute__((always_inline))

ISLET_INLINE Vec Load(const double* p) { return *reinterpret_cast<const VecAt*>(p); }
ISLET_INLINE void Store(double* p, Vec v) { *reinterpret_cast<VecAt*>(p) = v; }

// a b + c with one rounding where the machine has that: left to the compiler, whether it fuses depends on the size of the
// tile that it is in, and so would the bits on where lines are split.
ISLET_INLINE Vec MultiplyAdd(Vec a, double b, Vec c) {
#if ISLET_LANES == 8
  return (Vec)_mm512_fmadd_pd((__m512d)a, _mm512_set1_pd(b), (__m512d)c);
#elif ISLET_LANES == 4
  return (Vec)_mm256_fmadd_pd((__m256d)a, _mm256_set1_pd(b), (__m256d)c);
#else
  return a * b + c;
#endif
}

// Where the parts of Front::scratch begin, for the panel block at column j.
struct Scratch {
  Scratch(const Front& f, int j) : width(f.BlockColumns(j)) {
    inverse = f.scratch;
    triangle = inverse + width;
    packed = triangle + width * (width + f.block);
  }
  int width;
  double* inverse;   // sign / pivot, per column
  double* triangle;  // per group of N columns i: -L S of its rows, up to and with its own columns: (i + N) x N
  double* packed;    // -L S of the rows below, per group of N rows: width x N
};

// Position of group i (first column, multiple of N) in the triangle: sum of (q + N) N over the groups before.
template <int N>
ISLET_INLINE int TriangleAt(int i) {
  const int g = i / N;
  return N * N * (g * (g + 1) / 2);
}

// C = C + A B for T vectors of rows and N columns: C from `in` to `out`, A column-major, B k x N row by row.
template <int T, int N>
ISLET_INLINE void LoadTile(const double* c, int stride, Vec (&sum)[T][N]) {
  for (int j = 0; j < N; ++j)
    for (int t = 0; t < T; ++t) sum[t][j] = Load(c + j * stride + t * kLanes);
}
template <int T, int N>
ISLET_INLINE void StoreTile(const Vec (&sum)[T][N], double* c, int stride) {
  for (int j = 0; j < N; ++j)
    for (int t = 0; t < T; ++t) Store(c + j * stride + t * kLanes, sum[t][j]);
}
template <int T, int N>
ISLET_INLINE void AddMultiple(int k, const double* a, int lda, const double* b, Vec (&sum)[T][N]) {
  for (int p = 0; p < k; ++p, a += lda, b += N) {
    Vec column[T];
    for (int t = 0; t < T; ++t) column[t] = Load(a + t * kLanes);
    for (int j = 0; j < N; ++j)
      for (int t = 0; t < T; ++t) sum[t][j] = MultiplyAdd(column[t], b[j], sum[t][j]);
  }
}

// By how much whole vectors go beyond N numbers.
template <int N>
constexpr int kSpill = (N + kLanes - 1) / kLanes* kLanes - N;

// whole_vectors: what lies beyond the N rows may be read.
// out[p N + i] = -signs[p] a[i + p lda] for i in [from, to).
template <int N>
ISLET_INLINE void PackRows(int k, const double* a, int lda, const double* signs, int from, int to, bool whole_vectors,
                           double* out) {
  if (from == 0 && to == N) {
    // Whole vectors spill over into the place of the next column, which is written later; so not for the last one.
    int p = 0;
    for (; whole_vectors && kSpill<N> <= N && p + 1 < k; ++p, a += lda, out += N)
      for (int i = 0; i < N; i += kLanes) Store(out + i, Load(a + i) * -signs[p]);
    for (; p < k; ++p, a += lda, out += N)
      for (int i = 0; i < N; ++i) out[i] = -signs[p] * a[i];
  } else {
    for (int p = 0; p < k; ++p, a += lda, out += N)
      for (int i = from; i < to; ++i) out[i] = -signs[p] * a[i];
  }
}

// The rows of the lines [from, to) that lie below the panel block, for update_lines.
template <int N>
void PackLines(const Front& f, int j, int from, int to) {
  const Scratch s(f, j);
  const int begin = f.lead + j + s.width, end = to < f.lead + f.n ? to : f.lead + f.n;
  for (int line = from > begin ? from : begin; line < end;) {
    const int group = (line - begin) / N, first = begin + group * N;
    const int stop = end < first + N ? end : first + N;
    // The lines from `to` on may be another thread's.
    PackRows<N>(s.width, f.panel + first + j * f.panel_stride, f.panel_stride, f.signs + j, line - first, stop - first,
                first + N + kSpill<N> <= to, s.packed + group * N * s.width);
    line = stop;
  }
}

// Signed Cholesky of the N x N block at d, in place, its diagonal inverted. Returns the number of replaced pivots.
template <int N>
ISLET_INLINE int FactoriseDiagonal(double* d, int stride, const double* signs, double tiny) {
  int replaced = 0;
  double l[N][N];
  for (int j = 0; j < N; ++j)
    for (int i = j; i < N; ++i) l[i][j] = d[i + j * stride];
  for (int j = 0; j < N; ++j) {
    double pivot = signs[j] * l[j][j];
    if (!(pivot > tiny)) {
      pivot = 1e128;  // the row drops out of the solution, as in interior-point practice
      ++replaced;
    }
    const double inverse = 1 / __builtin_sqrt(pivot);
    l[j][j] = inverse;
    const double signed_inverse = signs[j] * inverse;
    for (int i = j + 1; i < N; ++i) l[i][j] *= signed_inverse;
    for (int q = j + 1; q < N; ++q) {
      const double factor = signs[j] * l[q][j];
      for (int i = q; i < N; ++i) l[i][q] -= factor * l[i][j];
    }
  }
  for (int j = 0; j < N; ++j)
    for (int i = j; i < N; ++i) d[i + j * stride] = l[i][j];
  return replaced;
}

// Columns i .. i+N-1 of the panel block at j, for T vectors of lines: X <- (X - earlier columns) L^-T S.
template <int T, int N>
ISLET_INLINE void SolveGroup(const Front& f, const Scratch& s, int j, int i, int line) {
  double* x = f.panel + line + (j + i) * f.panel_stride;
  const double* b = s.triangle + TriangleAt<N>(i);
  Vec sum[T][N];
  LoadTile<T, N>(x, f.panel_stride, sum);
  AddMultiple<T, N>(i, f.panel + line + j * f.panel_stride, f.panel_stride, b, sum);
  b += i * N;
  for (int p = 0; p < N; ++p) {
    for (int t = 0; t < T; ++t) sum[t][p] *= s.inverse[i + p];
    for (int q = p + 1; q < N; ++q)
      for (int t = 0; t < T; ++t) sum[t][q] = MultiplyAdd(sum[t][p], b[p * N + q], sum[t][q]);
  }
  StoreTile<T, N>(sum, x, f.panel_stride);
}

template <int N>
void SolveLines(const Front& f, int j, int from, int to) {
  const Scratch s(f, j);
  int line = from;
  for (; line + kTile * kLanes <= to; line += kTile * kLanes)
    for (int i = 0; i < s.width; i += N) SolveGroup<kTile, N>(f, s, j, i, line);
  for (; line < to; line += kLanes)
    for (int i = 0; i < s.width; i += N) SolveGroup<1, N>(f, s, j, i, line);
  if (j + s.width < f.n) PackLines<N>(f, j, from, to);
}

// The triangle of the panel block at j, and what shares its last vector of lines.
template <int N>
int Eliminate(const Front& f, int j) {
  const Scratch s(f, j);
  const int stride = f.panel_stride, end = f.SolveBegin(j);
  int replaced = 0;
  for (int i = 0; i < s.width; i += N) {
    const int line = f.lead + j + i, top = RoundDown(line);
    double* triangle = s.triangle + TriangleAt<N>(i);
    const double* rows = f.panel + line + j * stride;
    PackRows<N>(i, rows, stride, f.signs + j, 0, N, true, triangle);
    double diagonal[2 * kVector * N];  // N <= 8 rows lie in two vectors of 8
    for (int v = 0; v < 2 * kVector && top + v < line + N; v += kLanes) {
      Vec sum[1][N];
      LoadTile<1, N>(f.panel + top + v + (j + i) * stride, stride, sum);
      AddMultiple<1, N>(i, f.panel + top + v + j * stride, stride, triangle, sum);
      StoreTile<1, N>(sum, diagonal + v, 2 * kVector);
    }
    double* d = diagonal + (line - top);
    replaced += FactoriseDiagonal<N>(d, 2 * kVector, f.signs + j + i, f.tiny);
    for (int p = 0; p < N; ++p) {
      s.inverse[i + p] = f.signs[j + i + p] * d[p + p * 2 * kVector];
      for (int q = p + 1; q < N; ++q) triangle[(i + p) * N + q] = -f.signs[j + i + p] * d[q + p * 2 * kVector];
    }
    // Whole vectors: rows of the diagonal block are overwritten, and put back.
    int below = RoundDown(line + N);
    for (; below + kTile * kLanes <= end; below += kTile * kLanes) SolveGroup<kTile, N>(f, s, j, i, below);
    for (; below < end; below += kLanes) SolveGroup<1, N>(f, s, j, i, below);
    for (int q = 0; q < N; ++q)
      for (int p = q; p < N; ++p) f.panel[line + p + (j + i + q) * stride] = d[p + q * 2 * kVector];
  }
  if (j + s.width < f.n) PackLines<N>(f, j, f.lead + j + s.width, end);
  return replaced;
}

template <int T, int N>
ISLET_INLINE void UpdateTile(const Front& f, const Scratch& s, int j, int line, const double* b, double* c, int stride,
                             bool fresh) {
  Vec sum[T][N];
  if (fresh) {
    for (int q = 0; q < N; ++q)
      for (int t = 0; t < T; ++t) sum[t][q] = Vec{};
  } else {
    LoadTile<T, N>(c, stride, sum);
  }
  AddMultiple<T, N>(s.width, f.panel + line + j * f.panel_stride, f.panel_stride, b, sum);
  StoreTile<T, N>(sum, c, stride);
}

// Lines [from, to) of the columns behind the panel block; no split at line lead + k within.
template <int N>
void UpdatePart(const Front& f, int j, int from, int to) {
  const Scratch s(f, j);
  const int behind = j + s.width, tile = kTile * kLanes;
  const int middle = f.lead + f.k;
  for (int begin = from; begin < to; begin += tile) {
    const int end = begin + tile < to ? begin + tile : to;
    const double* b = s.packed;
    for (int c = behind; c < f.n && f.lead + c < end; c += N, b += N * s.width) {
      const int diagonal = (f.lead + c) / kLanes * kLanes;
      int line = diagonal > begin ? diagonal : begin;
      const bool in_panel = c < f.k;
      const int stride = in_panel ? f.panel_stride : f.update_stride;
      double* out = in_panel ? f.panel + c * stride : f.update + (c - f.k) * stride - middle;
      const bool fresh = !in_panel && f.fresh && j == 0;
      if (line + tile == end) {
        UpdateTile<kTile, N>(f, s, j, line, b, out + line, stride, fresh);
        continue;
      }
      if (kTile > 2 && line + 2 * kLanes <= end) {
        UpdateTile<2, N>(f, s, j, line, b, out + line, stride, fresh);
        line += 2 * kLanes;
      }
      for (; line < end; line += kLanes) UpdateTile<1, N>(f, s, j, line, b, out + line, stride, fresh);
    }
  }
}

template <int N>
void UpdateLines(const Front& f, int j, int from, int to) {
  const int middle = f.lead + f.k;
  if (from < middle) UpdatePart<N>(f, j, from, to < middle ? to : middle);
  if (to > middle) UpdatePart<N>(f, j, from > middle ? from : middle, to);
}

template <int N>
int FactoriseFront(const Front& f) {
  int replaced = 0;
  for (int j = 0; j < f.k; j += kPanelBlock) {
    replaced += Eliminate<N>(f, j);
    if (f.SolveBegin(j) < f.EndLine()) SolveLines<N>(f, j, f.SolveBegin(j), f.EndLine());
    if (j + f.BlockColumns(j) < f.n) UpdateLines<N>(f, j, f.UpdateBegin(j), f.EndLine());
  }
  return replaced;
}

void ExtendAdd(const Front& parent, int m, const int* to, const double* child, int begin, int end) {
  const int block = parent.block, child_stride = OddStride(m * block), columns = parent.k / block;
  for (int j = begin; j < end; ++j) {
    const bool in_panel = to[j] < columns;
    const int stride = in_panel ? parent.panel_stride : parent.update_stride;
    double* out = in_panel ? parent.panel + parent.lead + to[j] * block * stride
                           : parent.update + (to[j] - columns) * block * stride - parent.k;
    const double* in = child + j * block * child_stride;
    for (int i = j; i < m;) {  // runs of neighbouring rows
      int run = 1;
      while (i + run < m && to[i + run] == to[i] + run) ++run;
      const double* a = in + i * block;
      double* b = out + to[i] * block;
      const int rows = run * block;
      for (int q = 0; q < block; ++q, a += child_stride, b += stride) {
        int r = 0;
        for (; r + kLanes <= rows; r += kLanes) Store(b + r, Load(b + r) + Load(a + r));
        for (; r + 2 <= rows; r += 2) *reinterpret_cast<PairAt*>(b + r) += *reinterpret_cast<const PairAt*>(a + r);
        if (r < rows) b[r] += a[r];
      }
      i += run;
    }
  }
}

// x -= columns j .. j+N-1 times value, for the lines [from, to).
template <int N>
ISLET_INLINE void SubtractColumns(const double* columns, int stride, const double* value, int from, int to, double* x) {
  for (int line = from; line < to; line += kLanes) {
    Vec sum = Load(x + line);
    for (int p = 0; p < N; ++p) sum = MultiplyAdd(Load(columns + line + p * stride), -value[p], sum);
    Store(x + line, sum);
  }
}

// Solves the triangle of columns j .. j+N-1 in place; then the lines up to `end` of the vector that it ends in.
template <int N>
void ForwardBlock(const Front& f, int j, double* x) {
  const int stop = j + f.BlockColumns(j), end = f.SolveBegin(j);
  for (int c = j; c < stop; c += N) {
    const double* l = f.panel + c * f.panel_stride;
    double* own = x + f.lead + c;
    double value[N];
    for (int p = 0; p < N; ++p) value[p] = own[p];
    for (int p = 0; p < N; ++p) {
      const double* column = l + f.lead + c + p * f.panel_stride;
      value[p] *= column[p];
      for (int q = p + 1; q < N; ++q) value[q] -= column[q] * value[p];
    }
    for (int p = 0; p < N; ++p) own[p] = value[p];
    const int line = RoundDown(f.lead + c + N), stays = f.lead + c + N - line;
    if (line >= end) continue;
    double kept[kVector];  // whole vectors: what is overwritten before the first line is put back
    for (int q = 0; q < stays; ++q) kept[q] = x[line + q];
    SubtractColumns<N>(l, f.panel_stride, value, line, end, x);
    for (int q = 0; q < stays; ++q) x[line + q] = kept[q];
  }
}

template <int N>
void ForwardLines(const Front& f, int j, int from, int to, double* x) {
  const int stop = j + f.BlockColumns(j);
  for (int c = j; c < stop; c += N)
    SubtractColumns<N>(f.panel + c * f.panel_stride, f.panel_stride, x + f.lead + c, from, to, x);
}

// x[c] -= (column c below the panel block at j) x.
template <int N>
void BackwardColumns(const Front& f, int j, int from, int to, double* x) {
  const int first = f.lead + j + f.BlockColumns(j), end = f.lead + f.n;
  for (int c = from; c < to; c += N) {
    const double* l = f.panel + c * f.panel_stride;
    Vec sums[N] = {};
    double sum[N] = {};
    int line = first;
    for (; line < end && line % kLanes != 0; ++line)
      for (int p = 0; p < N; ++p) sum[p] += l[line + p * f.panel_stride] * x[line];
    for (; line + kLanes <= end; line += kLanes) {
      const Vec v = Load(x + line);
      for (int p = 0; p < N; ++p) sums[p] += Load(l + line + p * f.panel_stride) * v;
    }
    for (; line < end; ++line)
      for (int p = 0; p < N; ++p) sum[p] += l[line + p * f.panel_stride] * x[line];
    for (int p = 0; p < N; ++p) {
      for (int t = 0; t < kLanes; ++t) sum[p] += sums[p][t];
      x[f.lead + c + p] -= sum[p];
    }
  }
}

template <int N>
void BackwardBlock(const Front& f, int j, double* x) {
  const int stop = j + f.BlockColumns(j);
  for (int c = stop - N; c >= j; c -= N) {
    const double* l = f.panel + f.lead + c * f.panel_stride;
    double* own = x + f.lead;
    double sum[N] = {};
    for (int r = c + N; r < stop; ++r)
      for (int p = 0; p < N; ++p) sum[p] += l[r + p * f.panel_stride] * own[r];
    for (int p = N - 1; p >= 0; --p) {
      const double* column = l + p * f.panel_stride;
      double value = own[c + p] - sum[p];
      for (int q = p + 1; q < N; ++q) value -= column[c + q] * own[c + q];
      own[c + p] = value * column[c + p];
    }
  }
}

template <int N>
void ForwardFront(const Front& f, double* x) {
  for (int j = 0; j < f.k; j += kPanelBlock) {
    ForwardBlock<N>(f, j, x);
    ForwardLines<N>(f, j, f.SolveBegin(j), f.EndLine(), x);
  }
}

template <int N>
void BackwardFront(const Front& f, double* x) {
  for (int j = (f.k - 1) / kPanelBlock * kPanelBlock; j >= 0; j -= kPanelBlock) {
    BackwardColumns<N>(f, j, j, j + f.BlockColumns(j), x);
    BackwardBlock<N>(f, j, x);
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

template <int N>
constexpr FrontKernels kKernelsFor = {&FactoriseFront<N>, &Eliminate<N>,       &SolveLines<N>,    &UpdateLines<N>,
                                      &ExtendAdd,         &ForwardFront<N>,    &BackwardFront<N>, &ForwardBlock<N>,
                                      &ForwardLines<N>,   &BackwardColumns<N>, &BackwardBlock<N>, &AddProducts};

}  // namespace

extern const FrontKernelSet ISLET_KERNEL_SET;
const FrontKernelSet ISLET_KERNEL_SET = {ISLET_KERNEL_NAME, &kKernelsFor<1>, &kKernelsFor<3>, &kKernelsFor<6>};

}  // namespace islet::qp
