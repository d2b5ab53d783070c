// Dense kernels of the multifrontal factorisation, on one front. Compiled for several vector widths; the widest that
// the machine has is chosen once, at run time, so the library itself stays portable.
//
// A front of n rows and k eliminated columns (k <= n, both multiples of the block size) is stored as
//   panel   n x k, column-major, leading dimension PaddedRows(n): [L11; L21] after the factorisation
//   update  (n-k) x (n-k), column-major, leading dimension PaddedRows(n-k): Schur complement, lower triangle valid
// Whatever lies above the diagonal or in padding rows is scratch. A panel must be followed by kRowPadding readable numbers.
//
// Factorises A = L S L^T with S = diag(signs), signs +1 or -1 known beforehand: Cholesky if all are +1, and the stable
// LDL^T of a symmetric quasi-definite matrix otherwise [Van95].
#pragma once

namespace islet::qp {

inline constexpr int kRowPadding = 8;  // the widest vector, in doubles
inline constexpr int PaddedRows(int n) { return (n + kRowPadding - 1) / kRowPadding * kRowPadding; }

struct FrontKernels {
  const char* name;
  // Eliminates the k columns of the panel and subtracts their outer product from the update matrix (null if n == k).
  // signs: k numbers. Returns the number of pivots that had to be replaced because their sign was wrong or they were
  // not above `tiny` (0 in a healthy factorisation).
  int (*factorise)(int n, int k, int block, double tiny, const double* signs, double* panel, double* update);
  // x (n numbers, those of the front): x1 <- L11^-1 x1, x2 <- x2 - L21 x1.
  void (*forward)(int n, int k, const double* panel, double* x);
  // x1 <- L11^-T (x1 - L21^T x2).
  void (*backward)(int n, int k, const double* panel, double* x);
};

// The widest set that this machine can run. ISLET_KERNELS=sse2|avx2|avx512 in the environment chooses a narrower one.
const FrontKernels& BestFrontKernels();

// The set of that name, or null if this machine or build has none.
const FrontKernels* FindFrontKernels(const char* name);

}  // namespace islet::qp
