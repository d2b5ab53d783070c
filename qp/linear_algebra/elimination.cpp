#include "qp/linear_algebra/elimination.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace islet::qp {
namespace {

constexpr int kDenseNodes = 6;              // up to 36 unknowns, 72 with two fields
constexpr double kWorthDissecting = 0.8e6;  // [ns] of a factorisation in the order of minimum degree

}  // namespace

// Fitted to the kernels for vectors of 8: the rate of large products, what a front, a column, an entry of the panel and one
// of the update matrix cost on top.
double FrontTime(int columns, int below) {
  const double k = columns, m = below;
  const double flops = 216 * (k * k * k / 3 + k * k * m + k * m * m);
  return flops / 105 + 100 + 210 * k + 12.6 * k * (k + m) + 9 * m * m;
}

int FrontRow(const Elimination& e, int supernode, int row) {
  if (row < e.first[supernode + 1]) return row - e.first[supernode];
  const auto begin = e.rows.begin() + e.row_start[supernode], end = e.rows.begin() + e.row_start[supernode + 1];
  return e.columns(supernode) + static_cast<int>(std::lower_bound(begin, end, row) - begin);
}

// Each neighbour once, ascending: two passes of sorting by counting.
void EliminationAnalysis::MakeGraph(int n, std::span<const std::array<int, 2>> pairs) {
  start_.assign(n + 1, 0);
  for (const auto& [a, b] : pairs) {
    if (a != b) ++start_[a + 1], ++start_[b + 1];
  }
  std::partial_sum(start_.begin(), start_.end(), start_.begin());
  adjacency_.resize(start_[n]);
  stack_.resize(start_[n]);
  fill_.assign(start_.begin(), start_.end() - 1);
  for (const auto& [a, b] : pairs) {
    if (a != b) stack_[fill_[a]++] = b, stack_[fill_[b]++] = a;
  }
  fill_.assign(start_.begin(), start_.end() - 1);
  for (int i = 0; i < n; ++i)
    for (int e = start_[i]; e < start_[i + 1]; ++e) adjacency_[fill_[stack_[e]]++] = i;
  int kept = 0;
  for (int i = 0; i < n; ++i) {
    const int begin = start_[i], end = start_[i + 1];
    start_[i] = kept;
    for (int e = begin; e < end; ++e) {
      if (kept == start_[i] || adjacency_[kept - 1] != adjacency_[e]) adjacency_[kept++] = adjacency_[e];
    }
  }
  start_[n] = kept;
  adjacency_.resize(kept);
}

// Elimination tree of the graph in the given order, over positions [Liu90].
void EliminationAnalysis::EliminationTree(const Elimination& e) {
  const int n = e.num_nodes;
  parent_.assign(n, -1);
  mark_.assign(n, -1);  // an ancestor, paths shortened
  for (int k = 0; k < n; ++k) {
    for (int a = start_[e.order[k]]; a < start_[e.order[k] + 1]; ++a) {
      for (int i = e.position[adjacency_[a]]; i < k && i != -1;) {
        const int next = mark_[i];
        mark_[i] = k;
        if (next == -1) parent_[i] = k;
        i = next;
      }
    }
  }
}

// Entries of L below the diagonal, per column: row k of L is the subtree from the neighbours of k up to k.
void EliminationAnalysis::CountRows(const Elimination& e) {
  const int n = e.num_nodes;
  count_.assign(n, 0);
  mark_.assign(n, -1);
  for (int k = 0; k < n; ++k) {
    mark_[k] = k;
    for (int a = start_[e.order[k]]; a < start_[e.order[k] + 1]; ++a) {
      for (int i = e.position[adjacency_[a]]; i < k && mark_[i] != k; i = parent_[i]) {
        mark_[i] = k;
        ++count_[i];
      }
    }
  }
}

// Depth first; the child with the longest column last, where it can join its parent's supernode, the others ascending.
void EliminationAnalysis::Postorder(Elimination* e) {
  const int n = e->num_nodes;
  head_.assign(n, -1);
  next_.assign(n, -1);
  mark_.assign(n, -1);  // per position: its longest child
  for (int i = 0; i < n; ++i) {
    const int p = parent_[i];
    if (p >= 0 && (mark_[p] < 0 || count_[i] >= count_[mark_[p]])) mark_[p] = i;
  }
  for (int p = 0; p < n; ++p) head_[p] = mark_[p];
  for (int i = n - 1; i >= 0; --i) {
    if (parent_[i] >= 0 && mark_[parent_[i]] != i) next_[i] = head_[parent_[i]], head_[parent_[i]] = i;
  }
  sequence_.clear();
  for (int root = 0; root < n; ++root) {
    if (parent_[root] >= 0) continue;
    stack_.assign(1, root);
    while (!stack_.empty()) {
      const int i = stack_.back();
      if (head_[i] >= 0) {
        stack_.push_back(head_[i]);
        head_[i] = next_[head_[i]];
      } else {
        sequence_.push_back(i);
        stack_.pop_back();
      }
    }
  }
  old_order_.assign(e->order.begin(), e->order.end());
  moved_.resize(n);
  for (int k = 0; k < n; ++k) {
    e->order[k] = old_order_[sequence_[k]];
    e->position[e->order[k]] = k;
    moved_[sequence_[k]] = k;
  }
  head_.assign(parent_.begin(), parent_.end());
  next_.assign(count_.begin(), count_.end());
  for (int k = 0; k < n; ++k) {
    const int p = head_[sequence_[k]];
    parent_[k] = p < 0 ? -1 : moved_[p];
    count_[k] = next_[sequence_[k]];
  }
}

// Joins a run of columns with its parent right after it wherever that takes less time than two fronts: small fronts may
// store many zeros, large ones nearly none.
void EliminationAnalysis::FindSupernodes(Elimination* e) {
  runs_.clear();
  for (int k = 0; k < e->num_nodes; ++k) {
    Run run{k, k, count_[k], FrontTime(1, count_[k])};
    while (!runs_.empty() && parent_[runs_.back().last] == run.first) {
      const Run& before = runs_.back();
      const double time = FrontTime(run.last - before.first + 1, run.below);
      if (time > before.time + run.time) break;
      run = {before.first, run.last, run.below, time};
      runs_.pop_back();
    }
    runs_.push_back(run);
  }
  e->first.assign(1, 0);
  e->supernode_of.resize(e->num_nodes);
  for (const Run& run : runs_) {
    for (int k = run.first; k <= run.last; ++k) e->supernode_of[k] = static_cast<int>(e->first.size()) - 1;
    e->first.push_back(run.last + 1);
  }
}

// Rows of a supernode: what its columns touch in the graph, and the rows of its children.
void EliminationAnalysis::FindRows(Elimination* e) {
  const int count = e->num_supernodes();
  mark_.assign(e->num_nodes, -1);
  head_.assign(count, -1);  // children
  next_.assign(count, -1);
  e->row_start.assign(1, 0);
  e->rows.clear();
  for (int s = 0; s < count; ++s) {
    const auto add = [&](int row) {
      if (row >= e->first[s + 1] && mark_[row] != s) mark_[row] = s, e->rows.push_back(row);
    };
    for (int k = e->first[s]; k < e->first[s + 1]; ++k)
      for (int a = start_[e->order[k]]; a < start_[e->order[k] + 1]; ++a) add(e->position[adjacency_[a]]);
    for (int child = head_[s]; child >= 0; child = next_[child])
      for (int r = e->row_start[child]; r < e->row_start[child + 1]; ++r) add(e->rows[r]);
    const auto begin = e->rows.begin() + e->row_start[s];
    std::sort(begin, e->rows.end());
    if (begin != e->rows.end()) {
      const int p = e->supernode_of[*begin];
      next_[s] = head_[p], head_[p] = s;
    }
    e->row_start.push_back(static_cast<int>(e->rows.size()));
  }
}

void EliminationAnalysis::LinkSupernodes(Elimination* e) {
  const int count = e->num_supernodes();
  e->parent.assign(count, -1);
  e->child_start.assign(count + 1, 0);
  e->row_in_parent.resize(e->rows.size());
  e->flops_per_cubed_block = 0;
  for (int s = 0; s < count; ++s) {
    const double k = e->columns(s), m = e->below(s);
    e->flops_per_cubed_block += k * k * k / 3 + k * k * m + k * m * m;
    if (m == 0) continue;
    const int p = e->parent[s] = e->supernode_of[e->rows[e->row_start[s]]];
    ++e->child_start[p + 1];
    int r = e->row_start[s];
    for (; r < e->row_start[s + 1] && e->rows[r] < e->first[p + 1]; ++r) e->row_in_parent[r] = e->rows[r] - e->first[p];
    for (int q = e->row_start[p]; r < e->row_start[s + 1]; ++r) {
      while (e->rows[q] != e->rows[r]) ++q;
      e->row_in_parent[r] = e->columns(p) + q - e->row_start[p];
    }
  }
  std::partial_sum(e->child_start.begin(), e->child_start.end(), e->child_start.begin());
  e->children.resize(e->child_start[count]);
  fill_.assign(e->child_start.begin(), e->child_start.end() - 1);
  for (int s = 0; s < count; ++s)
    if (e->parent[s] >= 0) e->children[fill_[e->parent[s]]++] = s;
}

void EliminationAnalysis::Complete(Elimination* e) {
  e->position.resize(e->num_nodes);
  for (int k = 0; k < e->num_nodes; ++k) e->position[e->order[k]] = k;
  EliminationTree(*e);
  CountRows(*e);
  Postorder(e);
  FindSupernodes(e);
  FindRows(e);
  tasks_.Cut(e);
}

void EliminationAnalysis::Analyse(int num_nodes, std::span<const std::array<int, 2>> pairs, Elimination* out) {
  out->num_nodes = num_nodes;
  if (num_nodes > 0 && num_nodes <= kDenseNodes) {
    // One dense front in the given order: for a handful of bodies the bookkeeping of sparsity costs more than it saves.
    out->order.resize(num_nodes);
    std::iota(out->order.begin(), out->order.end(), 0);
    out->position = out->order;
    out->first.assign({0, num_nodes});
    out->row_start.assign({0, 0});
    out->rows.clear();
    out->supernode_of.assign(num_nodes, 0);
    out->task_start.assign({0, 1});
    out->model_time = FrontTime(num_nodes, 0);
    LinkSupernodes(out);
    return;
  }
  MakeGraph(num_nodes, pairs);
  minimum_degree_.Order({start_, adjacency_}, &out->order);
  Complete(out);
  if (out->model_time > kWorthDissecting) {
    other_.num_nodes = num_nodes;
    nested_dissection_.Order({start_, adjacency_}, &other_.order);
    Complete(&other_);
    if (other_.model_time < out->model_time) std::swap(*out, other_);
  }
  LinkSupernodes(out);
}

}  // namespace islet::qp
