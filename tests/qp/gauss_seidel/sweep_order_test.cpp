#include "qp/gauss_seidel/sweep_order.h"

#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "qp/gauss_seidel/sweep_kernels.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::kBatchLanes;
using qp::SweepOrder;

std::vector<int> BodiesOf(const ContactTerm& contact) {
  std::vector<int> bodies;
  for (int body : {contact.body_a, contact.body_b})
    if (body >= 0) bodies.push_back(body);
  return bodies;
}

// Batch of each contact; -1 where it is in none.
std::vector<int> BatchOf(const SweepOrder& order, const Problem& problem) {
  std::vector<int> batch(problem.contacts.size(), -1);
  for (size_t slot = 0; slot < order.contacts().size(); ++slot) {
    const int c = order.contacts()[slot];
    if (c < 0) continue;
    EXPECT_EQ(batch[c], -1) << "contact " << c << " twice";
    batch[c] = static_cast<int>(slot) / kBatchLanes;
  }
  return batch;
}

std::set<int> BodiesOfSection(const SweepOrder& order, const Problem& problem, const SweepOrder::Section& section) {
  std::set<int> bodies;
  for (int slot = section.first_batch * kBatchLanes; slot < (section.first_batch + section.num_batches) * kBatchLanes;
       ++slot) {
    if (order.contacts()[slot] < 0) continue;
    for (int body : BodiesOf(problem.contacts[order.contacts()[slot]])) bodies.insert(body);
  }
  return bodies;
}

void CheckOrder(const SweepOrder& order, const Problem& problem) {
  ASSERT_EQ(static_cast<int>(order.contacts().size()), order.num_batches() * kBatchLanes);
  const std::vector<int> batch = BatchOf(order, problem);
  EXPECT_EQ(std::count(batch.begin(), batch.end(), -1), 0);
  std::vector<int> section_of(order.num_batches(), -1);
  for (size_t s = 0; s < order.sections().size(); ++s)
    for (int b = 0; b < order.sections()[s].num_batches; ++b)
      section_of[order.sections()[s].first_batch + b] = static_cast<int>(s);
  // In problem order, so that within a section the last batch of a body only grows.
  std::vector<std::vector<int>> last(order.sections().size(), std::vector<int>(problem.bodies.size(), -1));
  for (size_t c = 0; c < batch.size(); ++c) {
    for (int body : BodiesOf(problem.contacts[c])) {
      int& before = last[section_of[batch[c]]][body];
      ASSERT_LT(before, batch[c]) << "contact " << c << ", body " << body;
      before = batch[c];
    }
  }
  ASSERT_EQ(order.phase_start().back(), static_cast<int>(order.sections().size()));
  for (size_t p = 0; p + 1 < order.phase_start().size(); ++p) {
    std::set<int> together;
    size_t sum = 0;
    for (int s = order.phase_start()[p]; s < order.phase_start()[p + 1]; ++s) {
      const std::set<int> bodies = BodiesOfSection(order, problem, order.sections()[s]);
      sum += bodies.size();
      together.insert(bodies.begin(), bodies.end());
    }
    EXPECT_EQ(together.size(), sum) << "sections of phase " << p << " share a body";
  }
}

// Each body has a place, and those of a part's section theirs side by side.
void CheckPlaces(const SweepOrder& order, const Problem& problem) {
  const std::set<int> places(order.places().begin(), order.places().end());
  ASSERT_EQ(places.size(), problem.bodies.size());
  ASSERT_EQ(static_cast<int>(order.body_start().size()), order.phase_start()[1] + 1);
  EXPECT_EQ(order.body_start().front(), 0);
  EXPECT_EQ(*places.rbegin(), order.body_start().back() - 1);
  for (int s = 0; s < order.phase_start()[1]; ++s) {
    for (const int body : BodiesOfSection(order, problem, order.sections()[s])) {
      EXPECT_GE(order.places()[body], order.body_start()[s]);
      EXPECT_LT(order.places()[body], order.body_start()[s + 1]);
    }
  }
}

TEST(SweepOrder, KeepsTheOrderOfContactsThatTouch) {
  SweepOrder order;
  for (const NamedProblem& island : RandomIslands(81, 40, 10, false)) {
    SCOPED_TRACE(island.name);
    for (int parts : {0, 1, 2, 3, 5}) {
      SCOPED_TRACE(parts);
      order.Build(island.problem, parts);
      CheckOrder(order, island.problem);
      CheckPlaces(order, island.problem);
    }
  }
}

// A star: all contacts are those of one body with others, so that of many parts only one has contacts of its own. And a pair.
TEST(SweepOrder, PartsWithoutContactsOfTheirOwn) {
  Problem problem;
  problem.bodies.resize(40);
  for (int c = 1; c < 40; ++c) problem.contacts.push_back({.body_a = 0, .body_b = c});
  Problem pair;  // all contacts between the two parts
  pair.bodies.resize(2);
  for (int c = 0; c < 8; ++c) pair.contacts.push_back({.body_a = 0, .body_b = 1});
  for (const Problem& cut : {problem, pair}) {
    for (const int parts : {2, 3, 5, 8}) {
      SCOPED_TRACE(parts);
      SweepOrder order;
      order.Build(cut, parts);
      CheckOrder(order, cut);
      CheckPlaces(order, cut);
    }
  }
}

TEST(SweepOrder, LargeIslandsAreCutInTwoHalvesOfAKind) {
  Random random(82);
  const Problem problem = RandomStack(&random, 600, 0.3, 0.6, 10);
  ASSERT_GE(problem.num_contacts(), 1500);
  SweepOrder order;
  order.Build(problem);
  CheckOrder(order, problem);
  CheckPlaces(order, problem);
  ASSERT_EQ(order.phase_start().size(), 3u);
  ASSERT_EQ(order.phase_start()[1], 2);
  EXPECT_NEAR(order.sections()[0].num_batches, order.sections()[1].num_batches, 0.1 * order.sections()[0].num_batches);
  EXPECT_LE(order.sections()[2].num_batches, 4);
}

// Contacts that have nothing to do with each other fill every lane.
TEST(SweepOrder, FillsTheLanes) {
  Problem problem;
  problem.bodies.resize(64);
  for (int c = 0; c < 64; ++c) problem.contacts.push_back({.body_a = -1, .body_b = c});
  SweepOrder order;
  order.Build(problem);
  EXPECT_EQ(order.num_batches(), 64 / kBatchLanes);
}

TEST(SweepOrder, NoContacts) {
  SweepOrder order;
  order.Build(Problem{});
  EXPECT_EQ(order.num_batches(), 0);
  EXPECT_TRUE(order.sections().empty());
}

}  // namespace
}  // namespace islet::testing
