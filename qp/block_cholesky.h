// Multifrontal factorisation of a symmetric matrix with one dense block per body and one per pair of touching bodies:
//   A = L S L^T,  S = diag(signs): Cholesky if all signs are +1, LDL^T of a quasi-definite matrix otherwise.
//
//   Analyse   symbolic, once per contact graph (kept if the graph is the same); allocates
//   SetZero, BlockAt, Factorise, Solve   numeric, every iteration; allocate nothing
//
// Blocks are assembled straight into the fronts, so the matrix is never stored twice. The order of all additions
// follows from the graph alone.                                                                         [DR83, Liu92]
//   threads: one caller at a time
#pragma once

#include <array>
#include <span>
#include <vector>

#include "qp/elimination.h"
#include "qp/front_kernels.h"

namespace islet::qp {

// Where the block of two nodes lives: column-major at data, `stride` numbers from column to column.
struct BlockPlace {
  double* data;
  int stride;
  bool transposed;  // rows belong to the second node asked for; false: to the first
};

class BlockCholesky {
 public:
  // block: unknowns per node, 1, 3, 6 or 12. pairs: as AnalyseElimination.
  void Analyse(int num_nodes, int block, std::span<const std::array<int, 2>> pairs);

  void SetZero();
  // The block of nodes a, b (a == b: diagonal, lower triangle used). The pair must have been in `pairs`.
  // The place stays valid until the next Analyse.
  BlockPlace BlockAt(int a, int b);

  // signs: one per unknown of a node, the same for all nodes. Returns the number of pivots that had to be replaced.
  int Factorise(std::span<const double> signs);

  // x (num_nodes * block numbers, node order): x <- A^-1 x.
  void Solve(double* x);

  const Elimination& elimination() const { return elimination_; }
  int block() const { return block_; }
  double Flops() const { return elimination_.flops_per_cubed_block * block_ * block_ * block_; }  // multiply-adds
  size_t FactorSize() const { return panels_.size(); }                                            // numbers stored

 private:
  void PlaceFronts();
  void AddChildren(int supernode);
  int FrontSize(int s) const { return (elimination_.columns(s) + elimination_.below(s)) * block_; }

  Elimination elimination_;
  std::vector<std::array<int, 2>> pairs_;  // as analysed, to recognise the same graph
  int num_nodes_ = -1;
  int block_ = 0;
  std::vector<size_t> panel_at_;   // per supernode, into panels_
  std::vector<size_t> update_at_;  // per supernode, into updates_
  std::vector<double> panels_, updates_;
  std::vector<double> signs_;             // of the widest panel
  std::vector<double> permuted_, local_;  // scratch of Solve
  const FrontKernels* kernels_ = &BestFrontKernels();
};

}  // namespace islet::qp
