#include "qp/elimination.h"

#include <algorithm>
#include <numeric>

#include "qp/ordering.h"

namespace islet::qp {
namespace {

constexpr int kDenseNodes = 6;  // up to 36 unknowns, 72 with two fields

struct Graph {
  std::vector<int> start, adjacency;
};

Graph MakeGraph(int n, std::span<const std::array<int, 2>> pairs) {
  std::vector<std::array<int, 2>> directed;
  directed.reserve(2 * pairs.size());
  for (const auto& [a, b] : pairs) {
    if (a == b) continue;
    directed.push_back({a, b});
    directed.push_back({b, a});
  }
  std::sort(directed.begin(), directed.end());
  directed.erase(std::unique(directed.begin(), directed.end()), directed.end());
  Graph graph;
  graph.start.assign(n + 1, 0);
  graph.adjacency.reserve(directed.size());
  for (const auto& [a, b] : directed) {
    ++graph.start[a + 1];
    graph.adjacency.push_back(b);
  }
  std::partial_sum(graph.start.begin(), graph.start.end(), graph.start.begin());
  return graph;
}

// Elimination tree of the graph in the given order, over positions [Liu90].
std::vector<int> EliminationTree(const Graph& graph, const std::vector<int>& order, const std::vector<int>& position) {
  const int n = static_cast<int>(order.size());
  std::vector<int> parent(n, -1), ancestor(n, -1);
  for (int k = 0; k < n; ++k) {
    for (int e = graph.start[order[k]]; e < graph.start[order[k] + 1]; ++e) {
      for (int i = position[graph.adjacency[e]]; i < k && i != -1;) {
        const int next = ancestor[i];
        ancestor[i] = k;
        if (next == -1) parent[i] = k;
        i = next;
      }
    }
  }
  return parent;
}

// Depth-first postorder; children in ascending order, so the result depends on the tree alone.
std::vector<int> Postorder(const std::vector<int>& parent) {
  const int n = static_cast<int>(parent.size());
  std::vector<int> head(n, -1), next(n, -1), stack, postorder;
  for (int i = n - 1; i >= 0; --i) {
    if (parent[i] >= 0) next[i] = head[parent[i]], head[parent[i]] = i;
  }
  postorder.reserve(n);
  for (int root = 0; root < n; ++root) {
    if (parent[root] >= 0) continue;
    stack.push_back(root);
    while (!stack.empty()) {
      const int i = stack.back();
      if (head[i] >= 0) {
        stack.push_back(head[i]);
        head[i] = next[head[i]];
      } else {
        postorder.push_back(i);
        stack.pop_back();
      }
    }
  }
  return postorder;
}

// Rows below the diagonal of every column of L, ascending.
std::vector<std::vector<int>> ColumnStructures(const Graph& graph, const Elimination& e,
                                               const std::vector<int>& parent) {
  const int n = e.num_nodes;
  std::vector<std::vector<int>> structure(n);
  std::vector<int> mark(n, -1);
  std::vector<std::vector<int>> children(n);
  for (int k = 0; k < n; ++k) {
    auto& rows = structure[k];
    mark[k] = k;
    const auto add = [&](int row) {
      if (row > k && mark[row] != k) mark[row] = k, rows.push_back(row);
    };
    for (int a = graph.start[e.order[k]]; a < graph.start[e.order[k] + 1]; ++a) add(e.position[graph.adjacency[a]]);
    for (int child : children[k])
      for (int row : structure[child]) add(row);
    std::sort(rows.begin(), rows.end());
    if (parent[k] >= 0) children[parent[k]].push_back(k);
  }
  return structure;
}

// Joins a supernode with the one right after it (its parent) while the zeros that this stores stay few. Wide fronts run
// several times faster per flop than narrow ones, so small supernodes may waste a lot.
bool WorthJoining(double columns, double zeros, double entries) {
  const double share = zeros / entries;
  return zeros == 0 || (columns <= 4 && share < 0.6) || (columns <= 12 && share < 0.2) || share < 0.05;
}

void FindSupernodes(const std::vector<std::vector<int>>& structure, const std::vector<int>& parent, Elimination* e) {
  const int n = e->num_nodes;
  struct Run {
    int first, last, below;
    double zeros;
  };
  std::vector<Run> runs;
  for (int k = 0; k < n; ++k) {
    Run run{k, k, static_cast<int>(structure[k].size()), 0};
    // The run that ends at k-1 can join if k is the parent of k-1 and, with the rows of k, it stays a good front.
    while (!runs.empty() && parent[runs.back().last] == run.first && runs.back().last + 1 == run.first) {
      const Run& before = runs.back();
      const double width_before = before.last - before.first + 1;
      const double width = run.last - run.first + 1;
      const double zeros = before.zeros + run.zeros + width_before * (width + run.below - before.below);
      const double total = width_before + width;
      const double entries = total * (total + 1) / 2 + total * run.below;
      if (!WorthJoining(total, zeros, entries)) break;
      run = {before.first, run.last, run.below, zeros};
      runs.pop_back();
    }
    runs.push_back(run);
  }
  e->first.assign(1, 0);
  e->row_start.assign(1, 0);
  e->rows.clear();
  e->supernode_of.resize(n);
  for (const Run& run : runs) {
    for (int k = run.first; k <= run.last; ++k) e->supernode_of[k] = static_cast<int>(e->first.size()) - 1;
    e->first.push_back(run.last + 1);
    e->rows.insert(e->rows.end(), structure[run.last].begin(), structure[run.last].end());
    e->row_start.push_back(static_cast<int>(e->rows.size()));
  }
}

void LinkSupernodes(Elimination* e) {
  const int count = e->num_supernodes();
  e->parent.assign(count, -1);
  e->child_start.assign(count + 1, 0);
  for (int s = 0; s < count; ++s) {
    if (e->below(s) == 0) continue;
    e->parent[s] = e->supernode_of[e->rows[e->row_start[s]]];
    ++e->child_start[e->parent[s] + 1];
  }
  std::partial_sum(e->child_start.begin(), e->child_start.end(), e->child_start.begin());
  e->children.resize(e->child_start[count]);
  std::vector<int> fill(e->child_start.begin(), e->child_start.end() - 1);
  e->row_in_parent.resize(e->rows.size());
  e->flops_per_cubed_block = 0;
  for (int s = 0; s < count; ++s) {
    const double k = e->columns(s), m = e->below(s);
    e->flops_per_cubed_block += k * k * k / 3 + k * k * m + k * m * m;
    if (e->parent[s] < 0) continue;
    e->children[fill[e->parent[s]]++] = s;
    for (int r = e->row_start[s]; r < e->row_start[s + 1]; ++r)
      e->row_in_parent[r] = FrontRow(*e, e->parent[s], e->rows[r]);
  }
}

// One dense front in the given order: for a handful of bodies the bookkeeping of sparsity costs more than it saves.
Elimination DenseElimination(int n) {
  Elimination e;
  e.num_nodes = n;
  e.order.resize(n);
  std::iota(e.order.begin(), e.order.end(), 0);
  e.position = e.order;
  e.first = {0, n};
  e.row_start = {0, 0};
  e.supernode_of.assign(n, 0);
  LinkSupernodes(&e);
  return e;
}

}  // namespace

int FrontRow(const Elimination& e, int supernode, int row) {
  if (row < e.first[supernode + 1]) return row - e.first[supernode];
  const auto begin = e.rows.begin() + e.row_start[supernode], end = e.rows.begin() + e.row_start[supernode + 1];
  return e.columns(supernode) + static_cast<int>(std::lower_bound(begin, end, row) - begin);
}

Elimination AnalyseElimination(int num_nodes, std::span<const std::array<int, 2>> pairs) {
  if (num_nodes > 0 && num_nodes <= kDenseNodes) return DenseElimination(num_nodes);
  Elimination e;
  e.num_nodes = num_nodes;
  const Graph graph = MakeGraph(num_nodes, pairs);
  std::vector<int> order = MinimumDegreeOrder(graph.start, graph.adjacency);
  e.position.resize(num_nodes);
  const auto invert = [&] {
    for (int k = 0; k < num_nodes; ++k) e.position[order[k]] = k;
  };
  invert();
  const std::vector<int> postorder = Postorder(EliminationTree(graph, order, e.position));
  e.order.resize(num_nodes);
  for (int k = 0; k < num_nodes; ++k) e.order[k] = order[postorder[k]];
  order = e.order;
  invert();
  const std::vector<int> parent = EliminationTree(graph, e.order, e.position);
  FindSupernodes(ColumnStructures(graph, e, parent), parent, &e);
  LinkSupernodes(&e);
  return e;
}

}  // namespace islet::qp
