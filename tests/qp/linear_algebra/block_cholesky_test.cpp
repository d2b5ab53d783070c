#include "qp/linear_algebra/block_cholesky.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "parallel/worker_pool.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Pairs = std::vector<std::array<int, 2>>;

// Pattern of a graph, values random, quasi-definite for the signs of a node.
struct System {
  int nodes, block;
  Pairs pairs;
  std::vector<double> signs;  // per unknown of a node
  MatrixXd a;
  Pairs blocks;  // the pairs, each once
};

void DrawValues(Random* random, System* system) {
  std::set<std::array<int, 2>> once;
  for (const auto& [p, q] : system->pairs)
    if (p != q) once.insert({std::min(p, q), std::max(p, q)});
  system->blocks.assign(once.begin(), once.end());
  const int b = system->block, n = system->nodes * b;
  system->a = MatrixXd::Zero(n, n);
  for (const auto& [p, q] : system->pairs) {
    if (p == q) continue;
    const MatrixXd values = MatrixXd::NullaryExpr(b, b, [&] { return random->Uniform(-1, 1); });
    system->a.block(p * b, q * b, b, b) = values;
    system->a.block(q * b, p * b, b, b) = values.transpose();
  }
  for (int i = 0; i < n; ++i) {
    for (int j = i / b * b; j < i; ++j) system->a(i, j) = system->a(j, i) = random->Uniform(-1, 1);
    double same_sign = 0.5;
    for (int j = 0; j < n; ++j)
      if (j != i && system->signs[i % b] == system->signs[j % b]) same_sign += std::abs(system->a(i, j));
    system->a(i, i) = 0;
    system->a(i, i) = system->signs[i % b] * (same_sign + b);
  }
}

System RandomSystem(Random* random, int nodes, int block, bool mixed_signs) {
  System system{nodes, block, {}, {}, {}, {}};
  const int edges = random->Integer(0, 3 * nodes);
  for (int e = 0; e < edges; ++e) {
    const int p = random->Integer(0, nodes - 1), q = random->Integer(0, nodes - 1);
    if (p != q) system.pairs.push_back({p, q});
  }
  for (int i = 0; i < block; ++i) system.signs.push_back(mixed_signs && i >= (block + 1) / 2 ? -1 : 1);
  DrawValues(random, &system);
  return system;
}

// Each supernode's own blocks when it is asked for.
int Fill(const System& system, qp::BlockCholesky* cholesky) {
  const int b = system.block;
  const auto put = [&](int p, int q) {
    const qp::BlockPlace place = cholesky->BlockAt(p, q);
    const int rows = place.transposed ? q : p, columns = place.transposed ? p : q;
    for (int j = 0; j < b; ++j)
      for (int i = 0; i < b; ++i) place.data[i + j * place.stride] += system.a(rows * b + i, columns * b + j);
  };
  return cholesky->Factorise(system.signs, [&](int s) {
    for (int i = 0; i < system.nodes; ++i)
      if (cholesky->SupernodeOf(i, i) == s) put(i, i);
    for (const auto& [p, q] : system.blocks)
      if (cholesky->SupernodeOf(p, q) == s) put(p, q);
  });
}

VectorXd RandomRightSide(Random* random, const System& system) {
  return VectorXd::NullaryExpr(system.a.rows(), [&] { return random->Uniform(-1, 1); });
}

TEST(BlockCholesky, TwoBodiesByHand) {
  // In each of six unknowns [4 2; 2 5] x = [8; 9]: x = (22, 20) / 16.
  qp::BlockCholesky cholesky;
  cholesky.Analyse(2, 6, Pairs{{0, 1}});
  const auto fill = [&](int supernode) {
    EXPECT_EQ(supernode, 0);
    const qp::BlockPlace first = cholesky.BlockAt(0, 0), second = cholesky.BlockAt(1, 1), both = cholesky.BlockAt(1, 0);
    for (int i = 0; i < 6; ++i) {
      first.data[i + i * first.stride] += 4;
      second.data[i + i * second.stride] += 5;
      both.data[i + i * both.stride] += 2;
    }
  };
  EXPECT_EQ(cholesky.Factorise(std::vector<double>(6, 1.0), fill), 0);
  double x[12];
  std::fill_n(x, 6, 8.0), std::fill_n(x + 6, 6, 9.0);
  cholesky.Solve(x);
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(x[i], 22.0 / 16, 1e-15);
    EXPECT_NEAR(x[6 + i], 20.0 / 16, 1e-15);
  }
}

TEST(BlockCholesky, AgreesWithDenseSolve) {
  Random random(31);
  qp::BlockCholesky cholesky;  // one object through all sizes: nothing of the last graph may stay behind
  for (int trial = 0; trial < 160; ++trial) {
    const int block = trial % 2 ? 6 : 12;
    const System system = RandomSystem(&random, random.Integer(1, block == 12 ? 18 : 40), block, trial % 4 >= 2);
    cholesky.Analyse(system.nodes, block, system.pairs);
    ASSERT_EQ(Fill(system, &cholesky), 0);
    const VectorXd b = RandomRightSide(&random, system);
    VectorXd x = b;
    cholesky.Solve(x.data());
    EXPECT_LT((x - system.a.partialPivLu().solve(b)).norm(), 1e-12 * (1 + b.norm())) << "trial " << trial;
  }
}

TEST(BlockCholesky, RefactorisingEqualsAFreshObjectBitForBit) {
  Random random(32);
  for (int trial = 0; trial < 20; ++trial) {
    System system = RandomSystem(&random, 25, trial % 2 ? 6 : 12, trial % 4 >= 2);
    qp::BlockCholesky used, fresh;
    used.Analyse(system.nodes, system.block, system.pairs);
    Fill(system, &used);
    DrawValues(&random, &system);
    Fill(system, &used);
    fresh.Analyse(system.nodes, system.block, system.pairs);
    Fill(system, &fresh);
    VectorXd x = RandomRightSide(&random, system), y = x;
    used.Solve(x.data());
    fresh.Solve(y.data());
    EXPECT_TRUE((x.array() == y.array()).all());
  }
}

TEST(BlockCholesky, AnalysisIsKeptForTheSameGraphOnly) {
  Random random(33);
  const System system = RandomSystem(&random, 20, 6, false);
  qp::BlockCholesky cholesky;
  cholesky.Analyse(20, 6, system.pairs);
  Fill(system, &cholesky);
  const double* place = cholesky.BlockAt(3, 3).data;
  {
    const AllocationCounter counter;
    cholesky.Analyse(20, 6, system.pairs);
    EXPECT_EQ(counter.count(), 0);
    EXPECT_EQ(cholesky.BlockAt(3, 3).data, place);
  }
  Pairs more = system.pairs;
  more.push_back({0, 19});
  cholesky.Analyse(20, 6, more);
  System larger = system;
  larger.pairs = more;
  DrawValues(&random, &larger);
  ASSERT_EQ(Fill(larger, &cholesky), 0);
  VectorXd b = RandomRightSide(&random, larger), x = b;
  cholesky.Solve(x.data());
  EXPECT_LT((larger.a * x - b).norm(), 1e-11);
}

TEST(BlockCholesky, NumericPhasesAllocateNothing) {
  Random random(34);
  for (const int block : {6, 12}) {
    System system = RandomSystem(&random, 40, block, block == 12);
    qp::BlockCholesky cholesky;
    cholesky.Analyse(system.nodes, block, system.pairs);
    VectorXd x = RandomRightSide(&random, system);
    const AllocationCounter counter;
    for (int repeat = 0; repeat < 3; ++repeat) {
      Fill(system, &cholesky);
      cholesky.Solve(x.data());
    }
    EXPECT_EQ(counter.count(), 0);
  }
}

// A grid in space, large enough for several tasks and for fronts that are split.
TEST(BlockCholesky, SameBitsForAnyNumberOfWorkers) {
  Random random(35);
  System system{9 * 9 * 6, 6, {}, {1, 1, 1, -1, -1, -1}, {}, {}};
  for (int i = 0; i < system.nodes; ++i) {
    if (i % 9 > 0) system.pairs.push_back({i, i - 1});
    if (i / 9 % 9 > 0) system.pairs.push_back({i, i - 9});
    if (i >= 81) system.pairs.push_back({i, i - 81});
  }
  DrawValues(&random, &system);
  const VectorXd b = RandomRightSide(&random, system);
  VectorXd expected;
  for (const int workers : {1, 2, 4}) {
    parallel::WorkerPool pool(workers);
    qp::BlockCholesky cholesky;
    cholesky.Analyse(system.nodes, system.block, system.pairs);
    EXPECT_GE(cholesky.elimination().num_tasks(), 2);
    EXPECT_LT(cholesky.elimination().top(), cholesky.elimination().num_supernodes());
    for (int repeat = 0; repeat < 5; ++repeat) {
      VectorXd x = b;
      pool.ForEach(1, [&](int, int) {
        EXPECT_EQ(Fill(system, &cholesky), 0);
        cholesky.Solve(x.data());
      });
      if (expected.size() == 0) expected = x;
      ASSERT_TRUE((x.array() == expected.array()).all()) << workers << " workers";
    }
  }
  EXPECT_LT((system.a * expected - b).norm(), 1e-12 * b.norm());
}

TEST(BlockCholesky, SingularMatrixIsCountedAndStaysFinite) {
  qp::BlockCholesky cholesky;
  cholesky.Analyse(2, 6, Pairs{{0, 1}});
  EXPECT_EQ(cholesky.Factorise(std::vector<double>(6, 1.0), [](int) {}), 12);
  double x[12] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
  cholesky.Solve(x);
  for (double value : x) EXPECT_TRUE(std::isfinite(value));
}

}  // namespace
}  // namespace islet::testing
