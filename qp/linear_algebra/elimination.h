// Symbolic phase of the multifrontal factorisation: which bodies are eliminated together, into fronts of which rows, and
// which parts are independent. Works on bodies, not on scalars: one node stands for a block of 6 or 12 unknowns.
//
//   in:  number of bodies and the pairs that share a contact      out: supernodes, children first, with their row structure
//   Kept as long as the graph stays the same: an interior-point method factorises the same pattern ten to forty times.
//
//        position k of a body in the elimination order            front of supernode s
//        0 1 | 2 | 3 4 5 | ...                                    rows: own columns, then rows(s) (ascending positions)
//
// The order is the one of minimum degree and nested dissection for which a model of the time on one and on two threads
// promises less. Supernodes come as tasks, each a set of whole subtrees that touches no other task's columns, and then
// the top, which needs all of them:
//        task 0 | task 1 | ... | top                              cut by the graph alone, whatever the number of threads
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "qp/linear_algebra/elimination_tasks.h"
#include "qp/linear_algebra/nested_dissection.h"
#include "qp/linear_algebra/ordering.h"

namespace islet::qp {

struct Elimination {
  int num_nodes = 0;
  std::vector<int> order;      // order[k]: node eliminated k-th
  std::vector<int> position;   // inverse of order
  std::vector<int> first;      // supernode s owns positions first[s] .. first[s+1]-1
  std::vector<int> row_start;  // rows below the own columns: rows[row_start[s] .. row_start[s+1]), ascending
  std::vector<int> rows;
  std::vector<int> parent;       // supernode that takes the update matrix of s, -1 at a root; parent[s] > s
  std::vector<int> child_start;  // children[child_start[s] .. child_start[s+1]), ascending
  std::vector<int> children;
  std::vector<int> row_in_parent;  // for each entry of rows: its row in the parent's front
  std::vector<int> supernode_of;   // per position
  std::vector<int>
      task_start;  // task t: supernodes task_start[t] .. task_start[t+1]-1; the top: from task_start.back()
  double flops_per_cubed_block = 0;  // additions and multiplications of the factorisation, in units of block^3
  double model_time = 0;             // [ns] of one factorisation with 6x6 blocks, mean of one and two threads

  int num_supernodes() const { return static_cast<int>(first.size()) - 1; }
  int num_tasks() const { return static_cast<int>(task_start.size()) - 1; }
  int top() const { return task_start.back(); }
  int columns(int s) const { return first[s + 1] - first[s]; }
  int below(int s) const { return row_start[s + 1] - row_start[s]; }
};

// Row of the front of the supernode that owns position `column`, for position `row` >= column.
int FrontRow(const Elimination& elimination, int supernode, int row);

// [ns] What a front of that many eliminated nodes and rows below takes, alone in one thread, 6x6 blocks.
double FrontTime(int columns, int below);

// Keeps its memory from graph to graph.
//   threads: one caller at a time; allocates only while graphs grow
class EliminationAnalysis {
 public:
  // pairs: nodes joined by at least one contact; repeated pairs and both orders allowed. A handful of nodes make one
  // dense front.
  void Analyse(int num_nodes, std::span<const std::array<int, 2>> pairs, Elimination* out);

 private:
  struct Run {
    int first, last, below;
    double time;
  };
  void MakeGraph(int n, std::span<const std::array<int, 2>> pairs);
  void Complete(Elimination* e);  // from e->order
  void EliminationTree(const Elimination& e);
  void CountRows(const Elimination& e);
  void Postorder(Elimination* e);
  void FindSupernodes(Elimination* e);
  void FindRows(Elimination* e);
  void LinkSupernodes(Elimination* e);

  MinimumDegree minimum_degree_;
  NestedDissection nested_dissection_;
  Elimination other_;
  std::vector<int> start_, adjacency_, fill_;  // the graph
  std::vector<int> parent_, count_;            // per position: elimination tree, entries of the column of L
  std::vector<int> mark_, head_, next_, stack_, sequence_;
  std::vector<Run> runs_;
  std::vector<int> moved_, old_order_;
  EliminationTasks tasks_;
};

}  // namespace islet::qp
