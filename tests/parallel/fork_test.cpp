#include "parallel/fork.h"

#include <atomic>
#include <numeric>
#include <set>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "parallel/worker_pool.h"

namespace islet::parallel {
namespace {

TEST(Fork, OutsideAPoolPiecesRunInOrderInTheCallingThread) {
  std::vector<int> order;
  const auto here = std::this_thread::get_id();
  Fork(5, [&](int piece) {
    EXPECT_EQ(std::this_thread::get_id(), here);
    order.push_back(piece);
  });
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3, 4}));
}

TEST(Fork, APoolOfOneWorkerStaysInTheCallingThread) {
  WorkerPool pool(1);
  const auto here = std::this_thread::get_id();
  pool.ForEach(1, [&](int, int) { Fork(8, [&](int) { EXPECT_EQ(std::this_thread::get_id(), here); }); });
}

TEST(Fork, EveryPieceRunsOnce) {
  WorkerPool pool(4);
  for (int round = 0; round < 200; ++round) {
    std::vector<std::atomic<int>> runs(97);
    pool.ForEach(3, [&](int, int) { Fork(97, [&](int piece) { runs[piece].fetch_add(1); }); });
    for (const std::atomic<int>& count : runs) ASSERT_EQ(count.load(), 3);
  }
}

// Two pieces that wait for each other can only end if two threads work on one task.
TEST(Fork, IdleWorkersJoinATaskThatForks) {
  WorkerPool pool(2);
  pool.ForEach(1, [&](int, int) {
    std::atomic<int> present{0};
    Fork(2, [&](int) {
      present.fetch_add(1);
      while (present.load() < 2) std::this_thread::yield();
    });
    EXPECT_EQ(present.load(), 2);
  });
}

TEST(Fork, NestedForksAddUp) {
  WorkerPool pool(3);
  std::vector<long> sums(4, 0);
  const auto sum = [](auto&& self, int first, int last) -> long {
    if (last - first <= 10) {
      long out = 0;
      for (int i = first; i < last; ++i) out += i;
      return out;
    }
    const int middle = (first + last) / 2;
    long left = 0, right = 0;
    Fork(2, [&](int half) { (half ? right : left) = half ? self(self, middle, last) : self(self, first, middle); });
    return left + right;
  };
  pool.ForEach(4, [&](int task, int) { sums[task] = sum(sum, 0, 5000); });
  for (const long value : sums) EXPECT_EQ(value, 4999L * 5000 / 2);
}

// A thread that waits for its pieces must not start another task on top of its own.
TEST(Fork, AWaitingTaskIsNotInterruptedByAnother) {
  WorkerPool pool(2);
  thread_local int depth = 0;
  std::atomic<int> deepest{0};
  pool.ForEach(50, [&](int, int) {
    ++depth;
    int seen = deepest.load();
    while (depth > seen && !deepest.compare_exchange_weak(seen, depth)) {
    }
    std::atomic<long> work{0};
    Fork(16, [&](int piece) {
      for (int i = 0; i < 1000; ++i) work.fetch_add(piece, std::memory_order_relaxed);
    });
    --depth;
  });
  EXPECT_EQ(deepest.load(), 1);
}

}  // namespace
}  // namespace islet::parallel
