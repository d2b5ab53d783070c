#include "tests/support/no_alloc.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstdlib>
#include <thread>
#include <vector>

namespace islet::testing {
namespace {

// A volatile store, so that the compiler cannot prove the memory unused and leave the allocation out.
void* volatile sink;
void Keep(void* memory) { sink = memory; }

TEST(AllocationCounter, CountsNothingWithoutAllocation) {
  std::vector<int> values(100);
  const AllocationCounter counter;
  values.assign(100, 3);
  Keep(values.data());
  EXPECT_EQ(counter.count(), 0);
}

TEST(AllocationCounter, CountsEveryWayToTakeMemory) {
  const AllocationCounter counter;
  std::vector<int> values(100);
  Keep(values.data());
  EXPECT_EQ(counter.count(), 1);
  Eigen::VectorXd vector(100);
  Keep(vector.data());
  EXPECT_EQ(counter.count(), 2);
  void* memory = std::malloc(10);
  Keep(memory);
  std::free(memory);
  EXPECT_EQ(counter.count(), 3);
  struct alignas(64) Line {
    char bytes[64];
  };
  auto* line = new Line;
  Keep(line);
  delete line;
  EXPECT_EQ(counter.count(), 4);
}

TEST(AllocationCounter, LeavesOtherThreadsOut) {
  long in_thread = 0;
  std::thread thread([&] {
    const AllocationCounter counter;
    for (int i = 0; i < 1000; ++i) {
      std::vector<int> values(10);
      Keep(values.data());
    }
    in_thread = counter.count();
  });
  const AllocationCounter counter;
  thread.join();
  EXPECT_EQ(in_thread, 1000);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
