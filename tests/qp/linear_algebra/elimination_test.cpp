#include "qp/linear_algebra/elimination.h"

#include <algorithm>
#include <numeric>
#include <set>

#include <gtest/gtest.h>

#include "qp/linear_algebra/nested_dissection.h"
#include "qp/linear_algebra/ordering.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::Elimination;
using Pairs = std::vector<std::array<int, 2>>;

Elimination Analyse(int n, const Pairs& pairs) {
  qp::EliminationAnalysis analysis;
  Elimination e;
  analysis.Analyse(n, pairs, &e);
  return e;
}

// True pattern of L by elimination on a full boolean matrix.
std::vector<std::set<int>> DenseSymbolic(const Elimination& e, const Pairs& pairs) {
  std::vector<std::set<int>> below(e.num_nodes);
  for (const auto& [a, b] : pairs) {
    const int pa = e.position[a], pb = e.position[b];
    if (pa != pb) below[std::min(pa, pb)].insert(std::max(pa, pb));
  }
  for (int k = 0; k < e.num_nodes; ++k)
    for (int i : below[k])
      for (int j : below[k])
        if (j > i) below[i].insert(j);
  return below;
}

bool IsPermutation(std::vector<int> order) {
  std::sort(order.begin(), order.end());
  for (size_t i = 0; i < order.size(); ++i)
    if (order[i] != static_cast<int>(i)) return false;
  return true;
}

// Everything the header promises.
void CheckStructure(int n, const Pairs& pairs) {
  const Elimination e = Analyse(n, pairs);
  ASSERT_EQ(e.num_nodes, n);
  ASSERT_EQ(static_cast<int>(e.order.size()), n);
  EXPECT_TRUE(IsPermutation(e.order));
  for (int k = 0; k < n; ++k) EXPECT_EQ(e.position[e.order[k]], k);
  ASSERT_EQ(e.first.front(), 0);
  ASSERT_EQ(e.first.back(), n);
  const auto fill = DenseSymbolic(e, pairs);
  double flops = 0;
  std::vector<std::vector<int>> children(e.num_supernodes());
  for (int s = 0; s < e.num_supernodes(); ++s) {
    ASSERT_GT(e.columns(s), 0);
    const std::vector<int> rows(e.rows.begin() + e.row_start[s], e.rows.begin() + e.row_start[s + 1]);
    EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
    EXPECT_EQ(std::adjacent_find(rows.begin(), rows.end()), rows.end());
    if (!rows.empty()) {
      EXPECT_GE(rows.front(), e.first[s + 1]);
    }
    for (int k = e.first[s]; k < e.first[s + 1]; ++k) {
      EXPECT_EQ(e.supernode_of[k], s);
      for (int row : fill[k])
        EXPECT_TRUE(row < e.first[s + 1] || std::binary_search(rows.begin(), rows.end(), row))
            << "row " << row << " column " << k;
    }
    const double k = e.columns(s), m = e.below(s);
    flops += k * k * k / 3 + k * k * m + k * m * m;
    EXPECT_EQ(e.parent[s] < 0, rows.empty());
    if (e.parent[s] < 0) continue;
    EXPECT_GT(e.parent[s], s);
    const auto task = [&](int supernode) {  // num_tasks() for the top
      return std::upper_bound(e.task_start.begin(), e.task_start.end(), supernode) - e.task_start.begin() - 1;
    };
    EXPECT_TRUE(task(e.parent[s]) == task(s) || e.parent[s] >= e.top());
    children[e.parent[s]].push_back(s);
    for (int r = e.row_start[s]; r < e.row_start[s + 1]; ++r) {  // the row exists in the parent, where it says
      const int p = e.parent[s], at = e.row_in_parent[r], row = e.rows[r];
      ASSERT_LT(at, e.columns(p) + e.below(p));
      EXPECT_EQ(at < e.columns(p) ? e.first[p] + at : e.rows[e.row_start[p] + at - e.columns(p)], row);
      EXPECT_EQ(at, qp::FrontRow(e, p, row));
    }
  }
  for (int s = 0; s < e.num_supernodes(); ++s) {
    const std::vector<int> listed(e.children.begin() + e.child_start[s], e.children.begin() + e.child_start[s + 1]);
    EXPECT_EQ(listed, children[s]);
  }
  EXPECT_NEAR(e.flops_per_cubed_block, flops, 1e-9 * (1 + flops));
}

Pairs RandomGraph(Random* random, int n, int edges) {
  Pairs pairs;
  for (int e = 0; e < edges && n > 1; ++e) pairs.push_back({random->Integer(0, n - 1), random->Integer(0, n - 1)});
  return pairs;
}

TEST(Elimination, OneNode) {
  const Elimination e = Analyse(1, {});
  ASSERT_EQ(e.num_supernodes(), 1);
  EXPECT_EQ(e.parent[0], -1);
  CheckStructure(1, {});
}

TEST(Elimination, NoNodes) { EXPECT_EQ(Analyse(0, {}).num_supernodes(), 0); }

TEST(Elimination, NoPairs) { CheckStructure(7, {}); }

TEST(Elimination, PairsMayRepeatInBothOrders) {
  const Elimination once = Analyse(3, Pairs{{0, 1}, {1, 2}});
  const Elimination often = Analyse(3, Pairs{{1, 0}, {1, 2}, {0, 1}, {2, 1}, {1, 1}});
  EXPECT_EQ(once.order, often.order);
  EXPECT_EQ(once.rows, often.rows);
}

TEST(Elimination, CliqueIsOneFront) {
  Pairs pairs;
  for (int a = 0; a < 6; ++a)
    for (int b = 0; b < a; ++b) pairs.push_back({a, b});
  const Elimination e = Analyse(6, pairs);
  EXPECT_EQ(e.num_supernodes(), 1);
  EXPECT_DOUBLE_EQ(e.flops_per_cubed_block, 72);
  CheckStructure(6, pairs);
}

TEST(Elimination, Disconnected) { CheckStructure(9, {{0, 3}, {3, 6}, {1, 4}, {4, 7}, {1, 7}}); }

Pairs Grid(int nx, int ny, int nz) {
  Pairs pairs;
  for (int i = 0; i < nx * ny * nz; ++i) {
    if (i % nx > 0) pairs.push_back({i, i - 1});
    if (i / nx % ny > 0) pairs.push_back({i, i - nx});
    if (i >= nx * ny) pairs.push_back({i, i - nx * ny});
  }
  return pairs;
}

TEST(Elimination, Grids) {
  CheckStructure(144, Grid(12, 12, 1));
  CheckStructure(448, Grid(8, 8, 7));
}

TEST(Elimination, LargeGraphsAreCutIntoTasks) {
  const Elimination grid = Analyse(1000, Grid(10, 10, 10));
  EXPECT_GE(grid.num_tasks(), 2);
  EXPECT_LT(grid.top(), grid.num_supernodes());
  EXPECT_EQ(Analyse(20, Grid(20, 1, 1)).num_tasks(), 1);
}

// Two graphs in turn, as an island changes from frame to frame.
TEST(Elimination, RepeatedAnalysesAllocateNothing) {
  const Pairs first = Grid(9, 9, 9), second = Grid(10, 10, 8);
  qp::EliminationAnalysis analysis;
  Elimination e;
  const auto both = [&] {
    analysis.Analyse(729, first, &e);
    analysis.Analyse(800, second, &e);
  };
  for (int warm_up = 0; warm_up < 3; ++warm_up) both();
  const AllocationCounter counter;
  both();
  EXPECT_EQ(counter.count(), 0);
}

TEST(Elimination, RandomGraphs) {
  Random random(11);
  for (int trial = 0; trial < 200; ++trial) {
    SCOPED_TRACE(trial);
    const int n = random.Integer(1, 60);
    CheckStructure(n, RandomGraph(&random, n, random.Integer(0, 3 * n)));
  }
}

TEST(Elimination, LongChain) {
  Pairs pairs;
  for (int i = 1; i < 3000; ++i) pairs.push_back({i, i - 1});
  CheckStructure(3000, pairs);
}

TEST(Ordering, TreesHaveNoFill) {
  // Minimum degree takes leaves first: every column of L has at most one row below.
  Random random(12);
  for (int trial = 0; trial < 20; ++trial) {
    const int n = 50;
    std::vector<std::vector<int>> neighbours(n);
    for (int i = 1; i < n; ++i) {
      const int p = random.Integer(0, i - 1);
      neighbours[i].push_back(p), neighbours[p].push_back(i);
    }
    std::vector<int> start(1, 0), adjacency;
    for (const auto& list : neighbours) {
      adjacency.insert(adjacency.end(), list.begin(), list.end());
      start.push_back(static_cast<int>(adjacency.size()));
    }
    std::vector<int> order;
    qp::MinimumDegree().Order({start, adjacency}, &order);
    ASSERT_TRUE(IsPermutation(order));
    std::vector<int> position(n);
    for (int k = 0; k < n; ++k) position[order[k]] = k;
    for (int i = 0; i < n; ++i) {
      const auto later = [&](int other) { return position[other] > position[i]; };
      EXPECT_LE(std::count_if(neighbours[i].begin(), neighbours[i].end(), later), 1);
    }
  }
}

struct Compressed {
  std::vector<int> start, adjacency;
};

Compressed Compress(int n, const Pairs& pairs) {
  std::vector<std::set<int>> neighbours(n);
  for (const auto& [a, b] : pairs)
    if (a != b) neighbours[a].insert(b), neighbours[b].insert(a);
  Compressed graph{{0}, {}};
  for (const auto& list : neighbours) {
    graph.adjacency.insert(graph.adjacency.end(), list.begin(), list.end());
    graph.start.push_back(static_cast<int>(graph.adjacency.size()));
  }
  return graph;
}

// Multiplications of an elimination in that order, about, on the true pattern.
double Work(const std::vector<int>& order, const Pairs& pairs) {
  Elimination e;
  e.num_nodes = static_cast<int>(order.size());
  e.position.resize(order.size());
  for (size_t k = 0; k < order.size(); ++k) e.position[order[k]] = static_cast<int>(k);
  double work = 0;
  for (const auto& rows : DenseSymbolic(e, pairs)) work += static_cast<double>(rows.size() * rows.size());
  return work;
}

TEST(Ordering, DissectionIsAPermutationOfAnyGraph) {
  Random random(13);
  qp::NestedDissection dissection;
  std::vector<int> order;
  for (const int n : {1, 2, 5, 100, 300, 700}) {
    for (const int edges : {0, n / 2, n, 4 * n}) {
      const Pairs pairs = RandomGraph(&random, n, edges);
      const Compressed graph = Compress(n, pairs);
      dissection.Order({graph.start, graph.adjacency}, &order);
      EXPECT_EQ(static_cast<int>(order.size()), n);
      EXPECT_TRUE(IsPermutation(order)) << n << " nodes, " << edges << " edges";
    }
  }
}

// On measured piles it saves up to a third; a regular lattice is the best case of minimum degree.
TEST(Ordering, DissectionOfALatticeTakesAboutTheWorkOfMinimumDegree) {
  const Pairs pairs = Grid(10, 10, 10);
  const Compressed graph = Compress(1000, pairs);
  std::vector<int> dissected, minimum_degree;
  qp::NestedDissection().Order({graph.start, graph.adjacency}, &dissected);
  qp::MinimumDegree().Order({graph.start, graph.adjacency}, &minimum_degree);
  EXPECT_LT(Work(dissected, pairs), 1.2 * Work(minimum_degree, pairs));
}

}  // namespace
}  // namespace islet::testing
