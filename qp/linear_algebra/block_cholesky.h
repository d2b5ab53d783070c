// Multifrontal factorisation of a symmetric matrix with one dense block per body and one per pair of touching bodies:
//   A = L S L^T,  S = diag(signs): Cholesky if all signs are +1, LDL^T of a quasi-definite matrix otherwise.
//
//   Analyse   symbolic, once per contact graph (kept if the graph is the same); allocates only while graphs grow
//   Factorise, Solve   numeric, every iteration; allocate nothing
//
// Blocks are assembled straight into the fronts, so the matrix is never stored twice. The order of all additions
// follows from the graph alone.                                                                         [DR83, Liu92]
//   threads: one caller at a time. Inside a task of a WorkerPool idle workers help (parallel/fork.h): the tasks of the
//            elimination run side by side, then the large fronts of the top are split. Same bits for any number of threads
#pragma once

#include <array>
#include <span>
#include <vector>

#include "parallel/fork.h"
#include "qp/linear_algebra/elimination.h"
#include "qp/linear_algebra/front_kernels.h"

namespace islet::qp {

// Where the block of two nodes lives: column-major at data, `stride` numbers from column to column.
struct BlockPlace {
  double* data;
  int stride;
  bool transposed;  // rows belong to the second node asked for; false: to the first
};

// Numbers from an address that a whole vector starts at. Keeps its memory; where it grows all are zero.
class AlignedNumbers {
 public:
  void Resize(size_t size);
  double* data() { return numbers_.data() + offset_; }

 private:
  std::vector<double> numbers_;
  size_t offset_ = 0;
};

class BlockCholesky {
 public:
  // block: unknowns per node, 6 or 12. pairs: as EliminationAnalysis. Returns false if all stayed as it was.
  bool Analyse(int num_nodes, int block, std::span<const std::array<int, 2>> pairs);

  // The block of nodes a, b (a == b: diagonal, lower triangle used). The pair must have been in `pairs`.
  // The place stays valid until the next Analyse.
  BlockPlace BlockAt(int a, int b);
  // The supernode that block is assembled in.
  int SupernodeOf(int a, int b) const;

  // fill(s) adds to the blocks of supernode s, which hold what its children left; it is called once for each s, from any
  // thread of the pool.
  // signs: one per unknown of a node, the same for all nodes. Returns the number of pivots that had to be replaced.
  int Factorise(std::span<const double> signs, parallel::PieceRef fill);

  // x (num_nodes * block numbers, node order): x <- A^-1 x.
  void Solve(double* x);

  const Elimination& elimination() const { return elimination_; }
  // Additions and multiplications of a factorisation.
  double Flops() const { return elimination_.flops_per_cubed_block * block_ * block_ * block_; }

 private:
  // Address space for the update matrices of fronts that are worked off in order: a front's own is needed while its
  // children's are still read, and each is free after its parent has been factorised. First fit, decided once.
  class SpacePlan {
   public:
    void Clear() { taken_.clear(), total_ = 0; }
    size_t Take(size_t size);
    void Free(size_t at);
    size_t total() const { return total_; }

   private:
    struct Interval {
      size_t at, size;
    };
    std::vector<Interval> taken_;  // ascending
    size_t total_ = 0;
  };

  void PlaceFronts();
  // Does the parent of s belong to the top, and s does not?
  bool LeavesTask(int s) const { return s < elimination_.top() && elimination_.parent[s] >= elimination_.top(); }
  void AddChildren(int s, int from, int end);
  int FactoriseFront(int s, parallel::PieceRef fill);
  int FactoriseShared(int s, parallel::PieceRef fill);
  double* RowsAt(int node, double* carry);
  void Gather(int s, double* lines, double* carry);
  void Forward(int begin, int end, double* lines, double* carry);  // carry: null in the top, and where there is none
  void Backward(int begin, int end, double* lines, bool shared);

  EliminationAnalysis analysis_;
  Elimination elimination_;
  SpacePlan plan_;
  std::vector<std::array<int, 2>> pairs_;  // as analysed, to recognise the same graph
  int num_nodes_ = -1;
  int block_ = 0;
  std::vector<Front> fronts_;  // per supernode
  std::vector<size_t>
      update_at_;  // per supernode: into updates_ if it leaves its task or is in the top, else into a region
  AlignedNumbers panels_, updates_, regions_, scratch_, lines_, carries_;
  size_t region_size_ = 0, scratch_size_ = 0, lines_size_ = 0, carry_size_ = 0;
  int top_nodes_ = 0;
  std::vector<double> signs_;     // of the widest panel
  std::vector<int> replaced_;     // pivots, per task
  std::vector<double> permuted_;  // right side in elimination order
  const FrontKernels* kernels_ = &BestFrontKernels();
};

}  // namespace islet::qp
