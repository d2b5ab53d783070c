#include "parallel/worker_pool.h"

#include <atomic>
#include <exception>
#include <limits>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/version.h>

#include "parallel/fork.h"
#include "parallel/tbb_version.h"

namespace islet::parallel {
namespace {

using Task = std::function<void(int index, int worker)>;

// The exception with the smallest index, so that the caller sees the same one whichever task ended first.
class FirstException {
 public:
  void Catch(int index) {
    const std::lock_guard lock(mutex_);
    if (index >= index_) return;
    index_ = index;
    exception_ = std::current_exception();
  }
  void Rethrow() const {
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  std::mutex mutex_;
  int index_ = std::numeric_limits<int>::max();
  std::exception_ptr exception_;
};

// One call of ForEach: workers draw indices from a shared counter, which starts tasks in list order whatever TBB does
// with the workers themselves.
class Run {
 public:
  Run(int num_tasks, int num_workers, const Task& task)
      : num_tasks_(num_tasks), num_workers_(num_workers), task_(task), team_(num_workers) {
    ended_.store(0, std::memory_order_release);
  }

  void Work(int worker) {
    static_cast<void>(ended_.load(std::memory_order_acquire));
    const ForkTeam::Member member(num_workers_ > 1 ? &team_ : nullptr);
    for (;;) {
      const int index = next_.fetch_add(1, std::memory_order_relaxed);
      if (index >= num_tasks_) break;
      try {
        task_(index, worker);
      } catch (...) {
        first_exception_.Catch(index);
      }
      tasks_done_.fetch_add(1, std::memory_order_release);
    }
    if (num_workers_ > 1) team_.HelpUntil(tasks_done_, num_tasks_);
    ended_.fetch_add(1, std::memory_order_release);
  }

  // Isolated twice: the calling thread, while it waits, must not pick up work of others; and a task that uses TBB
  // itself must not, while it waits, start the loop of another of our workers on top of its own.
  void WorkInArena() {
    tbb::this_task_arena::isolate([this] {
      tbb::parallel_for(
          0, num_workers_, 1, [this](int worker) { tbb::this_task_arena::isolate([this, worker] { Work(worker); }); },
          tbb::simple_partitioner());
    });
  }

  void Finish() const {
    static_cast<void>(ended_.load(std::memory_order_acquire));
    first_exception_.Rethrow();
  }

 private:
  const int num_tasks_;
  const int num_workers_;
  const Task& task_;
  std::atomic<int> next_{0};
  std::atomic<int> tasks_done_{0};
  ForkTeam team_;  // who has run out of tasks helps those that fork
  // Orders caller before tasks before caller. TBB does so too, but its library is not instrumented: this lets the
  // thread sanitizer see that order, and no other, so that a race between two tasks is still found.
  std::atomic<int> ended_{0};
  FirstException first_exception_;
};

constexpr int kMostWorkers = 1024;

int CheckedNumWorkers(int num_workers) {
  if (num_workers < 0 || num_workers > kMostWorkers) {
    throw std::invalid_argument("WorkerPool: num_workers = " + std::to_string(num_workers) + " must lie in 0 to " +
                                std::to_string(kMostWorkers));
  }
  return num_workers == 0 ? tbb::info::default_concurrency() : num_workers;
}

}  // namespace

struct [[gnu::visibility("hidden")]] WorkerPool::Impl {
  int num_workers = 1;
  Enter enter;                              // empty: the own arena
  std::optional<tbb::task_arena> arena;     // only with several workers and no `enter`
  std::optional<tbb::global_control> more;  // lets the arena have more threads than cores when asked for
};

WorkerPool::WorkerPool(int num_workers) : impl_(std::make_unique<Impl>()) {
  impl_->num_workers = CheckedNumWorkers(num_workers);
  if (impl_->num_workers == 1) return;
  if (impl_->num_workers > tbb::info::default_concurrency()) {
    impl_->more.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(impl_->num_workers));
  }
  impl_->arena.emplace(impl_->num_workers);
}

WorkerPool::WorkerPool(int num_workers, Enter enter) : impl_(std::make_unique<Impl>()) {
  if (!enter) throw std::invalid_argument("WorkerPool: enter is empty");
  impl_->num_workers = CheckedNumWorkers(num_workers);
  impl_->enter = std::move(enter);
}

WorkerPool::~WorkerPool() = default;

const char* TbbVersion() { return TBB_runtime_version(); }

int WorkerPool::num_workers() const { return impl_->num_workers; }

void WorkerPool::ForEach(int num_tasks, const Task& task) {
  if (num_tasks <= 0) return;
  Run run(num_tasks, impl_->num_workers, task);
  if (impl_->num_workers == 1) {
    run.Work(0);  // nothing to share: no TBB, not even the user's arena
  } else if (impl_->enter) {
    impl_->enter([&run] { run.WorkInArena(); });
  } else {
    impl_->arena->execute([&run] { run.WorkInArena(); });
  }
  run.Finish();
}

}  // namespace islet::parallel
