// Body of the kernels for one vector width. Included by front_kernels_<isa>.cpp, which define ISLET_LANES (doubles in a
// vector), ISLET_TILE (vectors in a tile of rows) and ISLET_KERNEL_SET (the name of the set). Nothing but builtins is
// used here: an inline function of a shared header, compiled with wider vectors, could be chosen by the linker for
// everyone.
#include "qp/front_kernels.h"

namespace islet::qp {
namespace {

constexpr int kLanes = ISLET_LANES;
constexpr int kTile = ISLET_TILE;
typedef double Vec __attribute__((vector_size(ISLET_LANES * sizeof(double)), aligned(sizeof(double)), may_alias));

inline Vec Load(const double* p) { return *reinterpret_cast<const Vec*>(p); }
inline void Store(double* p, Vec v) { *reinterpret_cast<Vec*>(p) = v; }

// C (rows x N) -= A (rows x k) diag(signs) B^T with B of N rows; rows = Tile * kLanes. Column-major, all of stride
// lda / lda / ldc. N columns of C stay in registers for the whole of k.
template <int Tile, int N>
inline void MultiplyTile(int k, const double* signs, const double* a, const double* b, int lda, double* c, int ldc) {
  Vec sum[Tile][N];
  for (int j = 0; j < N; ++j)
    for (int t = 0; t < Tile; ++t) sum[t][j] = Load(c + j * ldc + t * kLanes);
  for (int p = 0; p < k; ++p) {
    Vec column[Tile];
    for (int t = 0; t < Tile; ++t) column[t] = Load(a + t * kLanes);
    const double minus = -signs[p];
    for (int j = 0; j < N; ++j) {
      const double factor = minus * b[j];
      for (int t = 0; t < Tile; ++t) sum[t][j] += column[t] * factor;
    }
    a += lda;
    b += lda;
  }
  for (int j = 0; j < N; ++j)
    for (int t = 0; t < Tile; ++t) Store(c + j * ldc + t * kLanes, sum[t][j]);
}

// The same for any number of rows that is a multiple of kLanes.
template <int N>
inline void Multiply(int rows, int k, const double* signs, const double* a, const double* b, int lda, double* c,
                     int ldc) {
  int r = 0;
  for (; r + kTile * kLanes <= rows; r += kTile * kLanes) MultiplyTile<kTile, N>(k, signs, a + r, b, lda, c + r, ldc);
  for (; r < rows; r += kLanes) MultiplyTile<1, N>(k, signs, a + r, b, lda, c + r, ldc);
}

// Signed Cholesky of the N x N diagonal block at d. Returns the number of replaced pivots.
template <int N>
inline int FactoriseDiagonal(double* d, int ld, const double* signs, double tiny) {
  int replaced = 0;
  for (int j = 0; j < N; ++j) {
    double pivot = d[j + j * ld];
    for (int p = 0; p < j; ++p) pivot -= signs[p] * d[j + p * ld] * d[j + p * ld];
    pivot *= signs[j];
    if (!(pivot > tiny)) {
      pivot = 1e128;  // the row drops out of the solution, as in interior-point practice
      ++replaced;
    }
    const double root = __builtin_sqrt(pivot);
    d[j + j * ld] = root;
    const double inverse = signs[j] / root;
    for (int i = j + 1; i < N; ++i) {
      double value = d[i + j * ld];
      for (int p = 0; p < j; ++p) value -= signs[p] * d[i + p * ld] * d[j + p * ld];
      d[i + j * ld] = value * inverse;
    }
  }
  return replaced;
}

// Rows below the diagonal block l (N x N, packed): X <- X L^-T S, vectorised over rows.
template <int N>
inline void SolveBelow(int rows, const double* l, const double* signs, int ld, double* x) {
  double inverse[N];
  for (int j = 0; j < N; ++j) inverse[j] = signs[j] / l[j + j * N];
  for (int r = 0; r < rows; r += kLanes) {
    Vec row[N];
    for (int j = 0; j < N; ++j) {
      Vec value = Load(x + r + j * ld);
      for (int p = 0; p < j; ++p) value -= row[p] * (signs[p] * l[j + p * N]);
      row[j] = value * inverse[j];
      Store(x + r + j * ld, row[j]);
    }
  }
}

// Rows are rounded down to whole vectors at the start (what lies above the diagonal is scratch) and are padded at the
// end, so no kernel needs a remainder loop. The rows of the diagonal block itself must survive SolveBelow, though.
template <int N>
int FactoriseBlocks(int n, int k, double tiny, const double* signs, double* panel, double* update) {
  const int lda = PaddedRows(n);
  int replaced = 0;
  for (int j = 0; j < k; j += N) {
    const int top = j / kLanes * kLanes;
    if (j > 0) Multiply<N>(lda - top, j, signs, panel + top, panel + j, lda, panel + top + j * lda, lda);
    double* diagonal = panel + j + j * lda;
    replaced += FactoriseDiagonal<N>(diagonal, lda, signs + j, tiny);
    double block[N * N];  // SolveBelow starts at a whole vector, which may hold rows of the block: they are put back
    for (int c = 0; c < N; ++c)
      for (int r = 0; r < N; ++r) block[r + c * N] = diagonal[r + c * lda];
    const int below = (j + N) / kLanes * kLanes;
    SolveBelow<N>(lda - below, block, signs + j, lda, panel + below + j * lda);
    for (int c = 0; c < N; ++c)
      for (int r = 0; r < N; ++r) diagonal[r + c * lda] = block[r + c * N];
  }
  const int m = n - k;
  if (m == 0) return replaced;
  const int ldu = PaddedRows(m);
  // Whole vectors may read up to kRowPadding - 1 numbers past a column of the panel; they only reach padding of `update`.
  const double* lower = panel + k;
  for (int j = 0; j < m; j += N) {
    const int top = j / kLanes * kLanes;
    Multiply<N>(ldu - top, k, signs, lower + top, lower + j, lda, update + top + j * ldu, ldu);
  }
  return replaced;
}

int Factorise(int n, int k, int block, double tiny, const double* signs, double* panel, double* update) {
  if (block % 6 == 0) return FactoriseBlocks<6>(n, k, tiny, signs, panel, update);
  if (block % 3 == 0) return FactoriseBlocks<3>(n, k, tiny, signs, panel, update);
  return FactoriseBlocks<1>(n, k, tiny, signs, panel, update);
}

void Forward(int n, int k, const double* panel, double* x) {
  const int lda = PaddedRows(n);
  for (int p = 0; p < k; ++p) {
    const double* column = panel + p * lda;
    const double value = x[p] / column[p];
    x[p] = value;
    for (int r = p + 1; r < n; ++r) x[r] -= column[r] * value;
  }
}

void Backward(int n, int k, const double* panel, double* x) {
  const int lda = PaddedRows(n);
  for (int p = k - 1; p >= 0; --p) {
    const double* column = panel + p * lda;
    Vec sums = {};
    int r = p + 1;
    for (; r + kLanes <= n; r += kLanes) sums += Load(column + r) * Load(x + r);
    double sum = x[p];
    for (int i = 0; i < kLanes; ++i) sum -= sums[i];
    for (; r < n; ++r) sum -= column[r] * x[r];
    x[p] = sum / column[p];
  }
}

}  // namespace

extern const FrontKernels ISLET_KERNEL_SET;
const FrontKernels ISLET_KERNEL_SET = {ISLET_KERNEL_NAME, &Factorise, &Forward, &Backward};

}  // namespace islet::qp
