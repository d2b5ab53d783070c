// Runs independent tasks on a fixed number of workers. The only room that sees oneTBB (in worker_pool.cpp).
//
// Tasks are started in the order given, one at a time per worker, so a list sorted largest first is run largest first.
// Which worker takes which task depends on timing: a task may use its worker's scratch memory but nothing that it
// computes may depend on the worker's number.
//   threads: one caller at a time; a task that calls the pool that runs it gets std::logic_error
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <span>

#include "parallel/schedule.h"

namespace islet::parallel {

class WorkerPool {
 public:
  // num_workers >= 1; 0: as many as the machine has cores. With one worker tasks run in the calling thread.
  explicit WorkerPool(int num_workers = 0);

  // Runs inside the caller's own tbb::task_arena, without a TBB type in this header:
  //   WorkerPool pool(arena.max_concurrency(), [&](const std::function<void()>& work) { arena.execute(work); });
  using Enter = std::function<void(const std::function<void()>&)>;
  WorkerPool(int num_workers, Enter enter);  // see Enter

  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int num_workers() const;  // >= 1

  // task(index, worker) for index = 0 to num_tasks - 1, worker in [0, num_workers). Returns when all are done; the
  // first exception (by index) is rethrown then.
  void ForEach(int num_tasks, const std::function<void(int index, int worker)>& task);

  // The same for the pieces of a loop, which must not fork. The caller begins at the first and others at the last, so that in loops
  // that follow each other a worker mostly meets what it has in its cache.
  void ForPieces(int num_pieces, const std::function<void(int piece, int worker)>& run);

  // work(), in the calling thread where the arena lets it in, while the other workers wait for what it shares: every ForEach and
  // Fork in it begins at once, where each by itself would have to wake them. Rethrows what work throws.
  void Together(const std::function<void()>& work);

  // run(range, worker) for the ranges of a loop over 0 .. count-1, as pieces.
  template <typename F>
  void ForRanges(std::size_t count, const F& run) {
    const auto work = [&](int piece, int worker) {
      const std::size_t first = static_cast<std::size_t>(piece) * kAtOnce;
      run(Range{static_cast<std::size_t>(piece), first, std::min(count, first + kAtOnce)}, worker);
    };
    // By reference: a function object that holds more than two words allocates.
    ForPieces(static_cast<int>(NumRanges(count)), std::cref(work));
  }

  // f(i) for i = 0 .. count-1. What fits into one range runs in the calling thread.
  template <typename F>
  void ForEachOf(std::size_t count, const F& f) {
    const auto run = [&](const Range& range, int) {
      for (std::size_t i = range.first; i < range.last; ++i) f(i);
    };
    if (count <= kAtOnce) return run({0, 0, count}, 0);
    ForRanges(count, run);
  }

  // f(task, worker) for each of these costs, largest first, those below batch_cost in batches. schedule: scratch.
  template <typename F>
  void ForEachByCost(std::span<const double> costs, double batch_cost, Schedule* schedule, const F& f) {
    MakeSchedule(costs, batch_cost, schedule);
    const auto work = [&](int batch, int worker) {
      for (const int task : schedule->batch(batch)) f(task, worker);
    };
    ForEach(schedule->num_batches(), std::cref(work));
  }

 private:
  void RunAll(int count, bool in_order, const std::function<void(int, int)>& task);

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet::parallel
