// Dense kernels of the multifrontal factorisation, on one front. Compiled for several vector widths; the widest that
// the machine has is chosen once, at run time, so the library itself stays portable.
//
// A front of n rows and k eliminated columns (k <= n, both multiples of the block size, 6 or 12) is stored as
//   panel   n x k, column-major: [L11; L21] after the factorisation, the diagonal of L11 inverted
//   update  (n-k) x (n-k), column-major: Schur complement, lower triangle valid
// Entry (r, c) of the panel is at panel[lead + r + c * panel_stride]; `lead` makes row k start a whole vector, as column
// 0 of the update does. Below, a `line` is such a place in a column: lead + r. Strides are odd multiples of a vector, so
// that neighbouring columns do not compete for the same places of the cache. Whatever lies above the diagonal or in
// padding is scratch.
//
// Factorises A = L S L^T with S = diag(signs), signs +1 or -1 known beforehand: Cholesky if all are +1, and the stable
// LDL^T of a symmetric quasi-definite matrix otherwise [Van95].
//   threads: kernels on disjoint lines (or columns) of one front may run side by side; the bits do not depend on the split
#pragma once

#include <cstddef>

namespace islet::qp {

inline constexpr int kVector = 8;       // numbers in the widest vector: lines are split at multiples of it
inline constexpr int kPanelBlock = 96;  // columns eliminated at once, and lines in a piece; a multiple of kVector
inline constexpr int RoundUp(int n) { return (n + kVector - 1) / kVector * kVector; }
inline constexpr int RoundDown(int n) { return n / kVector * kVector; }
inline constexpr int OddStride(int rows) { return (RoundUp(rows) / kVector | 1) * kVector; }

struct Front {
  Front(int rows, int columns, int unknowns_per_node)
      : n(rows),
        k(columns),
        block(unknowns_per_node),
        lead((kVector - columns % kVector) % kVector),
        panel_stride(OddStride(lead + rows)),
        update_stride(OddStride(rows - columns)) {}

  size_t PanelSize() const { return static_cast<size_t>(panel_stride * k); }
  size_t UpdateSize() const { return static_cast<size_t>(update_stride * (n - k)); }
  // Numbers of scratch: rows of the panel block, transposed; its own triangle; its inverted pivots.
  size_t ScratchSize() const {
    const int width = k < kPanelBlock ? k : kPanelBlock;
    return RoundUp(width * (n + width + block + 1));
  }
  int BlockColumns(int j) const { return k - j < kPanelBlock ? k - j : kPanelBlock; }
  int EndLine() const { return RoundUp(lead + n); }
  int SolveBegin(int j) const { return RoundUp(lead + j + BlockColumns(j)); }
  int UpdateBegin(int j) const { return RoundDown(lead + j + BlockColumns(j)); }

  int n, k, block;
  int lead;
  ptrdiff_t panel_stride, update_stride;  // wide: a column of a huge front begins beyond what an int can count
  bool fresh = false;                     // the update matrix holds nothing yet and is overwritten
  const double* signs = nullptr;          // k numbers
  double* panel = nullptr;
  double* update = nullptr;  // unused if n == k
  double* scratch = nullptr;
};

// J_left^T D J_right of one contact, by the places of its rows and of D.
struct ContactProduct {
  int left, right;  // into an array of 3 x kVector numbers each: the rows of J, padded by zeros
  int contact;      // into an array of 3 x 3 numbers each
};

// The kernels of one vector width.
struct FrontKernels {
  // Eliminates the k columns of the panel and subtracts their outer product from the update matrix. Returns the number of
  // pivots that had to be replaced because their sign was wrong or they were zero (0 in a healthy one).
  int (*factorise)(const Front& front);
  // The same in parts, for j = 0, kPanelBlock, ... < k: eliminate, then solve_lines over SolveBegin(j) .. EndLine(), then
  // update_lines over UpdateBegin(j) .. EndLine(), the two latter in any split at multiples of kVector.
  int (*eliminate)(const Front& front, int j);
  void (*solve_lines)(const Front& front, int j, int from, int to);
  void (*update_lines)(const Front& front, int j, int from, int to);

  // Adds block columns begin .. end-1 of a child's update matrix (m blocks) to the parent's; child block i is its to[i].
  void (*extend_add)(const Front& parent, int m, const int* to, const double* child, int begin, int end);

  // x holds one number per line. With x1 the k upper ones: x1 <- L11^-1 x1, x2 <- x2 - L21 x1.
  void (*forward)(const Front& front, double* x);
  // x1 <- L11^-T (x1 - L21^T x2).
  void (*backward)(const Front& front, double* x);
  // In parts, for each panel block j (upwards, downwards): forward_block then forward_lines over SolveBegin(j) ..
  // EndLine(); backward_columns over its columns, then backward_block.
  void (*forward_block)(const Front& front, int j, double* x);
  void (*forward_lines)(const Front& front, int j, int from, int to, double* x);
  void (*backward_columns)(const Front& front, int j, int from, int to, double* x);
  void (*backward_block)(const Front& front, int j, double* x);

  // out (6x6, column-major) += sign * sum of the products; d: contacts' D, 9 numbers each, symmetric.
  void (*add_products)(int count, const ContactProduct* products, const double* rows, const double* d, double sign,
                       double* out, int stride);
};

// The set of the chosen width (build_facts.h).
const FrontKernels& BestFrontKernels();

// The set of that name, or null if this machine or build has none.
const FrontKernels* FindFrontKernels(const char* name);

}  // namespace islet::qp
