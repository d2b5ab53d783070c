#include "islands/partition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/support/no_alloc.h"

namespace islet::islands {
namespace {

using Pairs = std::vector<std::pair<int, int>>;
using Flags = std::vector<std::uint8_t>;
using Ints = std::vector<int>;

Ints ToVector(std::span<const int> values) { return {values.begin(), values.end()}; }

Partition Build(const Graph& graph) {
  Partition partition;
  BuildPartition(graph, &partition);
  return partition;
}

TEST(Partition, EmptyGraphHasNoIslands) {
  const Partition partition = Build({});
  EXPECT_EQ(partition.num_islands(), 0);
  EXPECT_EQ(partition.body_start, Ints{0});
  EXPECT_TRUE(partition.contacts.empty());
  EXPECT_EQ(Partition().num_islands(), 0);
}

TEST(Partition, BodyWithoutContactsIsAnIsland) {
  const Flags cut = {0, 1, 0};
  const Partition partition = Build({cut, {}});
  ASSERT_EQ(partition.num_islands(), 2);
  EXPECT_EQ(ToVector(partition.bodies_of(0)), Ints{0});
  EXPECT_EQ(ToVector(partition.bodies_of(1)), Ints{2});
  EXPECT_TRUE(partition.contacts_of(0).empty());
  EXPECT_EQ(partition.body_to_island, (Ints{0, -1, 1}));
}

// The drawing in partition.h, contacts given in a mixed-up order; body 0 touches nothing and 3-5 joins two cut bodies.
TEST(Partition, DrawingOfTheHeader) {
  const Flags cut = {0, 0, 0, 1, 0, 1, 0, 0};
  const Pairs contacts = {{7, 5}, {2, 3}, {3, 5}, {4, 7}, {2, 6}, {1, 2}, {3, 4}};
  const Partition partition = Build({cut, contacts});
  ASSERT_EQ(partition.num_islands(), 3);
  EXPECT_EQ(ToVector(partition.bodies_of(0)), Ints{0});
  EXPECT_EQ(ToVector(partition.bodies_of(1)), (Ints{1, 2, 6}));
  EXPECT_EQ(ToVector(partition.contacts_of(1)), (Ints{1, 4, 5}));
  EXPECT_EQ(ToVector(partition.bodies_of(2)), (Ints{4, 7}));
  EXPECT_EQ(ToVector(partition.contacts_of(2)), (Ints{0, 3, 6}));
  EXPECT_EQ(partition.body_to_island, (Ints{0, 1, 1, -1, 2, -1, 1, 2}));
}

TEST(Partition, FloorDoesNotJoinTwoStacks) {
  const Pairs contacts = {{0, 1}, {1, 2}, {0, 3}, {3, 4}};
  EXPECT_EQ(Build({Flags{1, 0, 0, 0, 0}, contacts}).num_islands(), 2);
  EXPECT_EQ(Build({Flags{0, 0, 0, 0, 0}, contacts}).num_islands(), 1);
}

TEST(Partition, SecondCutRefinesTheFirst) {
  Pairs chain;
  for (int body = 0; body + 1 < 10; ++body) chain.emplace_back(body, body + 1);
  Flags cut(10, 0);
  const Partition coarse = Build({cut, chain});
  cut[4] = 1;
  const Partition fine = Build({cut, chain});
  EXPECT_EQ(coarse.num_islands(), 1);
  ASSERT_EQ(fine.num_islands(), 2);
  EXPECT_EQ(ToVector(fine.contacts_of(0)), (Ints{0, 1, 2, 3}));  // 3-4 ends on the cut and belongs to the uncut side
  EXPECT_EQ(ToVector(fine.contacts_of(1)), (Ints{4, 5, 6, 7, 8}));
}

struct RandomGraph {
  Flags cut;
  Pairs contacts;
};

RandomGraph MakeRandomGraph(int num_bodies, int num_contacts, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> body(0, num_bodies - 1);
  RandomGraph graph;
  for (int i = 0; i < num_bodies; ++i) graph.cut.push_back(body(random) % 5 == 0);
  for (int i = 0; i < num_contacts; ++i) graph.contacts.emplace_back(body(random), body(random));
  return graph;
}

// The other way to the islands: flood from every body in ascending order.
Ints FloodIslands(const RandomGraph& graph) {
  const int num_bodies = static_cast<int>(graph.cut.size());
  Ints island(graph.cut.size(), -1);
  int num_islands = 0;
  for (int seed = 0; seed < num_bodies; ++seed) {
    if (graph.cut[seed] || island[seed] >= 0) continue;
    Ints stack = {seed};
    island[seed] = num_islands;
    while (!stack.empty()) {
      const int body = stack.back();
      stack.pop_back();
      for (const auto& [a, b] : graph.contacts) {
        if (a != body && b != body) continue;
        const int other = a == body ? b : a;
        if (graph.cut[other] || island[other] >= 0) continue;
        island[other] = num_islands;
        stack.push_back(other);
      }
    }
    ++num_islands;
  }
  return island;
}

TEST(Partition, AgreesWithFloodFill) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    const RandomGraph graph = MakeRandomGraph(40, static_cast<int>(seed % 60), seed);
    const Partition partition = Build({graph.cut, graph.contacts});
    EXPECT_EQ(partition.body_to_island, FloodIslands(graph)) << "seed " << seed;
    EXPECT_NO_THROW(CheckPartition({graph.cut, graph.contacts}, partition)) << "seed " << seed;
  }
}

TEST(Partition, OrderAndDirectionOfContactsDoNotMoveBodies) {
  RandomGraph graph = MakeRandomGraph(300, 260, 11);
  const Partition before = Build({graph.cut, graph.contacts});
  std::mt19937 random(12);
  std::shuffle(graph.contacts.begin(), graph.contacts.end(), random);
  for (auto& [a, b] : graph.contacts) std::swap(a, b);
  const Partition after = Build({graph.cut, graph.contacts});
  EXPECT_EQ(before.bodies, after.bodies);
  EXPECT_EQ(before.body_start, after.body_start);
  EXPECT_EQ(before.contact_start, after.contact_start);
}

TEST(Partition, ReusedMemoryGivesTheSameAndAllocatesNothing) {
#ifdef ISLET_VALIDATE
  GTEST_SKIP() << "the check after each build allocates";
#endif
  const RandomGraph large = MakeRandomGraph(500, 700, 1);
  const RandomGraph small = MakeRandomGraph(100, 90, 2);
  const Partition fresh = Build({small.cut, small.contacts});
  Partition partition;
  BuildPartition({Flags(500, 0), large.contacts}, &partition);  // most bodies and contacts kept
  BuildPartition({Flags(500, 0), {}}, &partition);              // most islands
  const testing::AllocationCounter counter;
  BuildPartition({large.cut, large.contacts}, &partition);
  BuildPartition({small.cut, small.contacts}, &partition);
  EXPECT_EQ(counter.count(), 0);
  EXPECT_EQ(partition, fresh);
}

TEST(CheckPartition, FindsEveryKindOfDamage) {
  const Flags cut = {0, 0, 1, 0, 0, 0};
  const Pairs contacts = {{0, 1}, {1, 2}, {2, 3}, {3, 4}};
  const Graph graph = {cut, contacts};
  const Partition good = Build(graph);
  ASSERT_EQ(good.num_islands(), 3);
  ASSERT_NO_THROW(CheckPartition(graph, good));
  const auto expect_caught = [&](auto damage) {
    Partition bad = good;
    damage(bad);
    EXPECT_THROW(CheckPartition(graph, bad), std::logic_error);
  };
  expect_caught([](Partition& p) { std::swap(p.bodies[0], p.bodies[1]); });
  expect_caught([](Partition& p) { p.bodies.pop_back(); });
  expect_caught([](Partition& p) { p.bodies[0] = 3; });
  expect_caught([](Partition& p) { p.contacts.push_back(0); });
  expect_caught([](Partition& p) { p.contact_start[1] = 1; });
  expect_caught([](Partition& p) { p.body_to_island[2] = 0; });
  expect_caught([](Partition& p) { p.body_to_island[4] = 0; });
  expect_caught([](Partition& p) { p.body_to_island[0] = 7; });
  // Consistent in itself, but one island where there are two: not connected.
  expect_caught([](Partition& p) {
    p.body_start = {0, 4, 5};
    p.contact_start = {0, 4, 4};
    p.body_to_island = {0, 0, -1, 0, 0, 1};
  });
  // Two islands numbered the wrong way round.
  expect_caught([](Partition& p) {
    p.body_start = {0, 2, 3, 5};
    p.bodies = {0, 1, 5, 3, 4};
    p.contact_start = {0, 2, 2, 4};
    p.body_to_island = {0, 0, -1, 2, 2, 1};
  });
}

}  // namespace
}  // namespace islet::islands
