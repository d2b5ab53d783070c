// Graphs, and the fill-reducing elimination order of minimum degree: best for small and for thin graphs. The only room that
// sees SuiteSparse (its AMD, BSD licence).
//
//   threads: one caller at a time; deterministic; allocates only while graphs grow
#pragma once

#include <span>
#include <vector>

namespace islet::qp {

// Symmetric graph in compressed form without self-loops: neighbours of i are adjacency[start[i] .. start[i+1]), ascending.
struct GraphView {
  std::span<const int> start, adjacency;
  int size() const { return static_cast<int>(start.size()) - 1; }
  std::span<const int> neighbours(int i) const { return adjacency.subspan(start[i], start[i + 1] - start[i]); }
};

class MinimumDegree {
 public:
  // order[k]: node eliminated k-th.
  void Order(GraphView graph, std::vector<int>* order);

 private:
  std::vector<int> work_;
};

}  // namespace islet::qp
