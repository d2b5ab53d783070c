// Fill-reducing elimination order by nested dissection: separators last, so that what they separate is independent; best for
// piles of hundreds of bodies. Separators are sought on coarser and coarser graphs and improved on the way back [FM82, KK98],
// down to pieces that exact minimum degree orders.
//
//   threads: one caller at a time; deterministic; allocates only while graphs grow
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "qp/linear_algebra/ordering.h"
#include "qp/linear_algebra/separator.h"

namespace islet::qp {

class NestedDissection {
 public:
  // order[k]: node eliminated k-th.
  void Order(GraphView graph, std::vector<int>* order);

 private:
  void Dissect(int begin, int end);
  bool Separate(int begin, int end);  // fills sides of levels_[0]; false: no separator worth it
  void TakePiece(int begin, int end);
  bool IsConnected();
  bool Coarsen(int level, bool backwards);
  void OrderPiece(int begin, int end);

  GraphView graph_;
  SeparatorSearch search_;
  std::vector<int> nodes_;             // the order so far: pieces are ranges of it
  std::vector<int> local_;             // per node of the graph: its place in the piece, -1 outside
  std::vector<WeightedGraph> levels_;  // the piece, and its coarser copies
  std::vector<Side> best_side_, best_coarse_;
  std::vector<int> before_, degree_, queue_, mark_;
  std::vector<std::uint64_t> rows_;  // bits, of OrderPiece
  std::array<int, 3> size_{};        // weights of the sides
  int total_ = 0;
};

}  // namespace islet::qp
