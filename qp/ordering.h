// Fill-reducing elimination orders of a graph. The only room that sees SuiteSparse (its AMD, BSD licence).
//
//   minimum degree      AMD: best for small and for thin graphs
//   nested dissection   separators last, so that what they separate is independent; best for piles of hundreds of bodies.
//                       Separators on coarser and coarser graphs, improved by moving single nodes [FM82, KK98], down to
//                       pieces that exact minimum degree orders
//
//   threads: one caller at a time; deterministic; allocates only while graphs grow
#pragma once

#include <array>
#include <cstdint>
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

class NestedDissection {
 public:
  void Order(GraphView graph, std::vector<int>* order);

 private:
  enum Side : std::uint8_t { kFirst, kSecond, kSeparator };

  // A piece of the graph, or a coarser copy of the level before.
  struct Level {
    int n = 0;
    std::vector<int> start, adjacency;
    std::vector<int> weight, edge;  // nodes of the graph in a node, its edges in an entry of adjacency
    std::vector<int> coarse;        // per node: its node in the next level
    std::vector<Side> side;
  };

  void Dissect(int begin, int end);
  bool Separate(int begin, int end);  // fills sides of levels_[0]; false: no separator worth it
  void TakePiece(int begin, int end);
  bool IsConnected();
  bool Coarsen(int level, bool backwards);
  void Halve(Level* level, int root);
  void Improve(Level* level);
  void ComputeGains(const Level& level, int node);
  void Enter(Level* level, int node);
  void Move(Level* level, int node, Side to);
  void OrderPiece(int begin, int end);

  GraphView graph_;
  std::vector<int> nodes_;  // the order so far: pieces are ranges of it
  std::vector<int> local_;  // per node of the graph: its place in the piece, -1 outside
  std::vector<Level> levels_;
  std::vector<Side> best_side_, best_coarse_;
  std::vector<int> separator_;            // nodes on side kSeparator
  std::vector<int> place_;                // per node: in separator_
  std::vector<std::array<int, 2>> gain_;  // of a separator's node: by how much the separator shrinks if it joins a side
  std::vector<int> moved_;                // per node: the pass that moved it last
  std::vector<int> undo_, queue_, mark_;
  std::vector<std::uint64_t> rows_;
  std::array<int, 3> size_{};  // weights of the sides
  int total_ = 0, pass_ = 0;
};

}  // namespace islet::qp
