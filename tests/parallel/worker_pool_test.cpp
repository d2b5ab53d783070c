#include "parallel/worker_pool.h"

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "parallel/fork.h"

namespace islet::parallel {
namespace {

class WorkerPoolOf : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Workers, WorkerPoolOf, ::testing::Values(1, 2, 4, 8));

TEST_P(WorkerPoolOf, RunsEveryIndexOnce) {
  WorkerPool pool(GetParam());
  EXPECT_EQ(pool.num_workers(), GetParam());
  for (const int num_tasks : {0, 1, 2, 7, 1000}) {
    std::vector<std::atomic<int>> runs(static_cast<std::size_t>(num_tasks));
    pool.ForEach(num_tasks, [&](int index, int worker) {
      EXPECT_TRUE(0 <= worker && worker < GetParam());
      ++runs[static_cast<std::size_t>(index)];
    });
    for (const auto& count : runs) EXPECT_EQ(count, 1);
  }
}

TEST_P(WorkerPoolOf, ChunksHoldEveryIndexOnce) {
  WorkerPool pool(GetParam());
  for (const std::size_t count : {0U, 1U, 127U, 128U, 129U, 1000U}) {
    std::vector<std::atomic<int>> runs(count);
    pool.ForEachOf(count, [&](std::size_t index) { ++runs.at(index); });
    for (const auto& times : runs) EXPECT_EQ(times, 1);
  }
}

TEST_P(WorkerPoolOf, NegativeCountIsNoTasks) {
  WorkerPool pool(GetParam());
  pool.ForEach(-3, [](int, int) { FAIL(); });
}

// What makes scratch memory per worker safe.
TEST_P(WorkerPoolOf, OneWorkerNumberNeverRunsTwoTasksAtOnce) {
  WorkerPool pool(GetParam());
  std::vector<std::atomic<int>> inside(static_cast<std::size_t>(GetParam()));
  std::atomic<int> violations = 0;
  pool.ForEach(400, [&](int, int worker) {
    std::atomic<int>& mine = inside[static_cast<std::size_t>(worker)];
    if (mine.fetch_add(1) != 0) ++violations;
    std::this_thread::yield();
    mine.fetch_sub(1);
  });
  EXPECT_EQ(violations, 0);
}

// The same although the tasks use TBB themselves: while one waits there, its thread must not start another of ours.
TEST_P(WorkerPoolOf, TasksThatWaitInTbbAreNotInterrupted) {
  WorkerPool pool(GetParam());
  std::atomic<int> violations = 0;
  std::atomic<int> inner = 0;
  pool.ForEach(50, [&](int, int) {
    thread_local int depth = 0;
    if (++depth != 1) ++violations;
    tbb::parallel_for(0, 64, [&](int) {
      ++inner;
      std::this_thread::yield();
    });
    --depth;
  });
  EXPECT_EQ(violations, 0);
  EXPECT_EQ(inner, 50 * 64);
}

// A worker draws the smallest index not yet started, so its own indices ascend.
TEST_P(WorkerPoolOf, StartsInListOrder) {
  WorkerPool pool(GetParam());
  std::vector<std::vector<int>> seen(static_cast<std::size_t>(GetParam()));
  pool.ForEach(500, [&](int index, int worker) { seen[static_cast<std::size_t>(worker)].push_back(index); });
  for (const auto& indices : seen) EXPECT_TRUE(std::is_sorted(indices.begin(), indices.end()));
}

TEST_P(WorkerPoolOf, RethrowsTheFirstExceptionByIndexAfterAllTasks) {
  WorkerPool pool(GetParam());
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::atomic<int> runs = 0;
    try {
      pool.ForEach(100, [&](int index, int) {
        ++runs;
        // The lowest failing index takes longest, so that by time it would be the last.
        if (index == 3) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        if (index % 10 == 3) throw std::runtime_error(std::to_string(index));
      });
      FAIL() << "no exception";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "3");
    }
    EXPECT_EQ(runs, 100);
  }
  std::atomic<int> runs = 0;
  pool.ForEach(10, [&](int, int) { ++runs; });
  EXPECT_EQ(runs, 10);  // and the pool works on
}

TEST_P(WorkerPoolOf, PiecesRunOnceAndRethrowTheFirstException) {
  WorkerPool pool(GetParam());
  std::vector<std::atomic<int>> runs(100);
  const auto run = [&](int piece, int worker) {
    EXPECT_TRUE(0 <= worker && worker < GetParam());
    ++runs[static_cast<std::size_t>(piece)];
    if (piece % 10 == 3) throw std::runtime_error(std::to_string(piece));
  };
  try {
    pool.ForPieces(100, run);
    FAIL() << "no exception";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "3");
  }
  for (const auto& count : runs) EXPECT_EQ(count, 1);
}

// Loops one after the other, for which workers are called once.
TEST_P(WorkerPoolOf, WorkTogetherRunsInTheCallingThread) {
  WorkerPool pool(GetParam());
  const std::thread::id caller = std::this_thread::get_id();
  std::vector<std::atomic<int>> runs(300);
  const auto count = [&](std::size_t index) { ++runs[index]; };
  pool.Together([&] {
    EXPECT_EQ(std::this_thread::get_id(), caller);
    for (int round = 0; round < 100; ++round) {
      pool.ForEach(300, [&](int index, int) { count(static_cast<std::size_t>(index)); });
      pool.ForPieces(300, [&](int index, int) { count(static_cast<std::size_t>(index)); });
      pool.ForEachOf(300, count);
    }
    pool.Together([&] { EXPECT_EQ(std::this_thread::get_id(), caller); });
  });
  for (const auto& times : runs) EXPECT_EQ(times, 300);
  EXPECT_THROW(pool.Together([] { throw std::runtime_error("work"); }), std::runtime_error);
  pool.ForEachOf(300, count);  // and the pool works on
  EXPECT_EQ(runs[299], 301);
}

// While a task waits for its pieces its thread helps with those of others, but starts no other task: they share a worker's scratch.
TEST_P(WorkerPoolOf, TasksThatForkAreNotInterrupted) {
  WorkerPool pool(GetParam());
  std::atomic<int> violations = 0, pieces = 0;
  pool.Together([&] {
    pool.ForEach(200, [&](int, int) {
      thread_local bool inside = false;
      if (std::exchange(inside, true)) ++violations;
      Fork(7, [&](int) {
        ++pieces;
        std::this_thread::yield();
      });
      inside = false;
    });
  });
  EXPECT_EQ(violations, 0);
  EXPECT_EQ(pieces, 1400);
}

TEST_P(WorkerPoolOf, ATaskThatCallsItsPoolIsTold) {
  WorkerPool pool(GetParam()), other(GetParam());
  std::atomic<int> runs = 0;
  EXPECT_THROW(pool.ForEach(20, [&](int, int) { pool.ForEach(2, [](int, int) {}); }), std::logic_error);
  EXPECT_THROW(pool.ForPieces(20, [&](int, int) { pool.ForEachOf(1000, [](std::size_t) {}); }), std::logic_error);
  pool.ForEach(1, [&](int, int) { other.ForEach(20, [&](int, int) { ++runs; }); });
  EXPECT_EQ(runs, 20);
}

// Whoever cancels a loop of his own, in which he steps a world, does not mean the world's.
TEST_P(WorkerPoolOf, WorksInACancelledLoopOfTheUser) {
  WorkerPool pool(GetParam(), [](const std::function<void()>& work) { work(); });
  tbb::task_group_context context;
  std::atomic<int> runs = 0;
  tbb::parallel_for(
      0, 1,
      [&](int) {
        context.cancel_group_execution();
        pool.ForEach(100, [&](int, int) { ++runs; });
      },
      context);
  EXPECT_EQ(runs, 100);
}

TEST(WorkerPool, WhatDoesNotEnterIsTold) {
  WorkerPool pool(2, [](const std::function<void()>&) {});
  EXPECT_THROW(pool.ForEach(3, [](int, int) {}), std::logic_error);
}

TEST(WorkerPool, OneWorkerRunsInTheCallingThreadInOrder) {
  WorkerPool pool(1);
  std::vector<int> order;
  const std::thread::id caller = std::this_thread::get_id();
  pool.ForEach(5, [&](int index, int worker) {
    EXPECT_EQ(worker, 0);
    EXPECT_EQ(std::this_thread::get_id(), caller);
    order.push_back(index);
  });
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3, 4}));
}

// All eight wait for each other: with fewer threads than workers this would never end, hence the deadline.
TEST(WorkerPool, HasAsManyThreadsAsWorkersEvenBeyondTheCores) {
  constexpr int kWorkers = 8;
  WorkerPool pool(kWorkers);
  std::atomic<int> arrived = 0;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  pool.ForEach(kWorkers, [&](int, int) {
    ++arrived;
    while (arrived < kWorkers && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
  });
  EXPECT_EQ(arrived, kWorkers);
  EXPECT_LT(std::chrono::steady_clock::now(), deadline);
}

TEST(WorkerPool, RunsInTheArenaOfTheUser) {
  constexpr int kConcurrency = 7;  // not what an arena of TBB's own has on common machines
  tbb::task_arena arena(kConcurrency);
  int entered = 0;
  WorkerPool pool(arena.max_concurrency(), [&](const std::function<void()>& work) {
    ++entered;
    arena.execute(work);
  });
  std::atomic<int> outside = 0;
  std::vector<std::atomic<int>> runs(100);
  pool.ForEach(100, [&](int index, int) {
    if (tbb::this_task_arena::max_concurrency() != kConcurrency) ++outside;
    ++runs[static_cast<std::size_t>(index)];
  });
  EXPECT_EQ(entered, 1);
  EXPECT_EQ(outside, 0);
  for (const auto& count : runs) EXPECT_EQ(count, 1);
}

// More workers than the arena has threads: the work is still done, by those there are.
TEST(WorkerPool, ArenaMayBeSmallerThanThePool) {
  tbb::task_arena arena(1);
  WorkerPool pool(4, [&](const std::function<void()>& work) { arena.execute(work); });
  std::atomic<int> runs = 0;
  pool.ForEach(30, [&](int, int) { ++runs; });
  EXPECT_EQ(runs, 30);
}

TEST(WorkerPool, TwoPoolsMayBeNested) {
  WorkerPool outer(2);
  WorkerPool inner(1);  // inline, hence safe from any thread at once
  std::atomic<int> runs = 0;
  outer.ForEach(10, [&](int, int) { inner.ForEach(10, [&](int, int) { ++runs; }); });
  EXPECT_EQ(runs, 100);
}

TEST(WorkerPool, RefusesBadArguments) {
  EXPECT_THROW(WorkerPool(-1), std::invalid_argument);
  EXPECT_THROW(WorkerPool(2, WorkerPool::Enter()), std::invalid_argument);
  EXPECT_GE(WorkerPool(0).num_workers(), 1);
}

}  // namespace
}  // namespace islet::parallel
