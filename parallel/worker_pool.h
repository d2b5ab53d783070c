// Runs independent tasks on a fixed number of workers. The only room that sees oneTBB (in worker_pool.cpp).
//
// Tasks are started in the order given, one at a time per worker, so a list sorted largest first is run largest first.
// Which worker takes which task depends on timing: a task may use its worker's scratch memory but nothing that it
// computes may depend on the worker's number.
//   threads: ForEach from one thread at a time; a task must not call ForEach of the same pool
#pragma once

#include <functional>
#include <memory>

namespace islet::parallel {

class WorkerPool {
 public:
  // num_workers >= 1; 0: as many as the machine has cores. With one worker tasks run in the calling thread.
  explicit WorkerPool(int num_workers = 0);

  // Runs inside the caller's own tbb::task_arena, without a TBB type in this header:
  //   WorkerPool pool(arena.max_concurrency(), [&](const std::function<void()>& work) { arena.execute(work); });
  using Enter = std::function<void(const std::function<void()>&)>;
  WorkerPool(int num_workers, Enter enter);

  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int num_workers() const;

  // task(index, worker) for index = 0 .. num_tasks-1, worker in [0, num_workers). Returns when all are done; the first
  // exception (by index) is rethrown then.
  void ForEach(int num_tasks, const std::function<void(int index, int worker)>& task);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace islet::parallel
