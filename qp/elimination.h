// Symbolic phase of the multifrontal factorisation: which bodies are eliminated together, into fronts of which rows.
// Works on bodies, not on scalars: one node stands for a block of 3, 6 or 12 unknowns.
//
//   in:  number of bodies and the pairs that share a contact      out: supernodes in postorder with their row structure
//   Kept as long as the graph stays the same: an interior-point method factorises the same pattern ten to forty times.
//
//        position k of a body in the elimination order            front of supernode s
//        0 1 | 2 | 3 4 5 | ...                                    rows: own columns, then rows(s) (ascending positions)
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

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
  std::vector<int> row_in_parent;    // for each entry of rows: its row in the parent's front
  std::vector<int> supernode_of;     // per position
  double flops_per_cubed_block = 0;  // multiply-adds of the factorisation, in units of block^3

  int num_supernodes() const { return static_cast<int>(first.size()) - 1; }
  int columns(int s) const { return first[s + 1] - first[s]; }
  int below(int s) const { return row_start[s + 1] - row_start[s]; }
};

// pairs: nodes joined by at least one contact; repeated pairs and both orders allowed. Up to six nodes make one dense front.
Elimination AnalyseElimination(int num_nodes, std::span<const std::array<int, 2>> pairs);

// Row of the front of the supernode that owns position `column`, for position `row` >= column.
int FrontRow(const Elimination& elimination, int supernode, int row);

}  // namespace islet::qp
