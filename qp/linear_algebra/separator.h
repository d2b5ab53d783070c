// Separators of a graph: a small set of nodes without which the rest falls into two halves of about the same weight. A
// first one by breadth, improved by moving single nodes between the separator and the halves.            [FM82]
//
//   in:  a graph with weights      out: the side of every node, in the graph itself, and the weights of the sides
//   threads: one caller at a time; deterministic; allocates only while graphs grow
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace islet::qp {

enum Side : std::uint8_t { kFirst, kSecond, kSeparator };

// Symmetric, in compressed form: a piece of a graph, or a coarser copy of another.
struct WeightedGraph {
  int n = 0;
  std::vector<int> start, adjacency;
  std::vector<int> weight, edge;  // original nodes in a node, original edges in an entry of adjacency
  std::vector<int> coarse;        // per node: its node in the next coarser graph
  std::vector<Side> side;
};

class SeparatorSearch {
 public:
  // For graphs of up to that many nodes.
  void Reset(int nodes);
  // total: weight of the whole graph. What is nearest to root, half of the weight, is first; the separator is what of the
  // rest touches it.
  void Halve(int total, int root, WeightedGraph* graph);
  void Improve(int total, WeightedGraph* graph);
  const std::array<int, 3>& size() const { return size_; }  // weights of the sides, after Improve

 private:
  void CountSides(const WeightedGraph& graph);
  bool Pass(int limit, WeightedGraph* graph);
  int Choose(int limit, const WeightedGraph& graph, Side* to) const;
  void Enter(WeightedGraph* graph, int node);
  void Leave(WeightedGraph* graph, int node, Side to);
  void Move(WeightedGraph* graph, int node, Side to);
  void Return(WeightedGraph* graph, size_t length);
  void ComputeGains(const WeightedGraph& graph, int node);

  std::vector<int> separator_;            // nodes on side kSeparator
  std::vector<int> place_;                // per node: in separator_
  std::vector<std::array<int, 2>> gain_;  // of a separator's node: by how much the separator shrinks if it joins a side
  std::vector<int> moved_;                // per node: the pass that moved it last
  std::vector<int> undo_;                 // moves of a pass: node, side that it came from
  std::vector<int> queue_;
  std::array<int, 3> size_{};
  int pass_ = 0;
};

}  // namespace islet::qp
