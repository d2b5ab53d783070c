#include "parallel/schedule.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "tests/support/no_alloc.h"

namespace islet::parallel {
namespace {

using Ints = std::vector<int>;

Schedule Make(const std::vector<double>& costs, double batch_cost) {
  Schedule schedule;
  MakeSchedule(costs, batch_cost, &schedule);
  return schedule;
}

TEST(Schedule, SortsAndKeepsTheOrderOfEqualCosts) {
  EXPECT_EQ(Make({1, 5, 5, 2, 5, 1}, 0).order, (Ints{1, 2, 4, 3, 0, 5}));
}

TEST(Schedule, AgreesWithStableSort) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> cost(0, 9);
  std::vector<double> costs(1000);
  for (double& value : costs) value = cost(random);
  Ints expected(costs.size());
  for (int i = 0; i < 1000; ++i) expected[i] = i;
  std::stable_sort(expected.begin(), expected.end(), [&](int a, int b) { return costs[a] > costs[b]; });
  EXPECT_EQ(Make(costs, 0).order, expected);
}

TEST(Schedule, NoTasksNoBatches) {
  EXPECT_EQ(Make({}, 1).num_batches(), 0);
  EXPECT_EQ(Schedule().num_batches(), 0);
}

TEST(Schedule, LargeTasksStandAloneAndSmallOnesShare) {
  const Schedule schedule = Make({1, 20, 4, 4, 10, 3, 1}, 10);
  EXPECT_EQ(schedule.order, (Ints{1, 4, 2, 3, 5, 0, 6}));
  EXPECT_EQ(schedule.batch_start, (Ints{0, 1, 2, 5, 7}));  // 20 | 10 | 4+4+3 | 1+1, the rest
  ASSERT_EQ(schedule.num_batches(), 4);
  EXPECT_EQ(Ints(schedule.batch(2).begin(), schedule.batch(2).end()), (Ints{2, 3, 5}));
}

TEST(Schedule, ThresholdZeroMeansOneTaskEach) { EXPECT_EQ(Make({0, 2, 0}, 0).batch_start, (Ints{0, 1, 2, 3})); }

TEST(Schedule, FreeTasksShareOneBatch) { EXPECT_EQ(Make({0, 0, 0}, 1).batch_start, (Ints{0, 3})); }

TEST(Schedule, BatchesCoverAllTasksAndStayBelowTwiceTheThreshold) {
  std::mt19937 random(4);
  std::exponential_distribution<double> cost(1);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> costs(200);
    for (double& value : costs) value = cost(random);
    const Schedule schedule = Make(costs, 1.5);
    ASSERT_EQ(schedule.batch_start.back(), 200);
    for (int batch = 0; batch < schedule.num_batches(); ++batch) {
      double sum = 0;
      for (const int task : schedule.batch(batch)) sum += costs[task];
      ASSERT_FALSE(schedule.batch(batch).empty());
      EXPECT_TRUE(schedule.batch(batch).size() == 1 || sum < 3);
      EXPECT_TRUE(batch + 1 == schedule.num_batches() || sum >= 1.5);
    }
    Ints sorted = schedule.order;
    std::sort(sorted.begin(), sorted.end());
    for (int task = 0; task < 200; ++task) EXPECT_EQ(sorted[task], task);
  }
}

TEST(Schedule, ReusedMemoryAllocatesNothing) {
  const std::vector<double> costs(300, 0.25);
  Schedule schedule;
  MakeSchedule(costs, 1, &schedule);
  const testing::AllocationCounter counter;
  MakeSchedule(costs, 0, &schedule);
  EXPECT_EQ(counter.count(), 0);
}

TEST(Schedule, RefusesCostsThatCannotBeOrdered) {
  EXPECT_THROW(Make({1, -1}, 1), std::invalid_argument);
  EXPECT_THROW(Make({1, std::numeric_limits<double>::quiet_NaN()}, 1), std::invalid_argument);
  EXPECT_THROW(Make({1}, std::numeric_limits<double>::infinity()), std::invalid_argument);
}

}  // namespace
}  // namespace islet::parallel
