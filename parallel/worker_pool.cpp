#include "parallel/worker_pool.h"

#include <atomic>
#include <exception>
#include <limits>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_group.h>
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

// One call of Together: the thread that enters does the work, and the other workers take up its tasks and pieces.
class Run {
 public:
  Run(int num_workers, const void* pool, const std::function<void()>& work)
      : num_workers_(num_workers), work_(work), team_(pool) {
    ended_.store(0, std::memory_order_release);
  }

  // Isolated twice: the thread that does the work, while it waits, must not pick up work of others; and a task that uses TBB
  // itself must not, while it waits, start the loop of another of our workers on top of its own.
  void WorkInArena() {
    const std::thread::id first = std::this_thread::get_id();
    tbb::task_group_context context(
        tbb::task_group_context::isolated);  // who cancels work of his own does not mean ours
    tbb::this_task_arena::isolate([this, first, &context] {
      tbb::parallel_for(
          0, num_workers_, 1,
          [this, first](int) {
            tbb::this_task_arena::isolate([this, first] { std::this_thread::get_id() == first ? Work() : Help(); });
          },
          tbb::simple_partitioner(), context);
    });
  }

  void Finish() const {
    static_cast<void>(ended_.load(std::memory_order_acquire));
    if (!begun_) throw std::logic_error("WorkerPool: enter did not run the work that it was given");
    if (exception_) std::rethrow_exception(exception_);
  }

 private:
  // Of several turns that nobody else took the first.
  void Work() {
    if (std::exchange(begun_, true)) return;
    static_cast<void>(ended_.load(std::memory_order_acquire));
    const ForkTeam::Member member(&team_, 0);
    try {
      work_();
    } catch (...) {
      exception_ = std::current_exception();
    }
    done_.store(1, std::memory_order_release);
    ended_.fetch_add(1, std::memory_order_release);
  }

  void Help() {
    static_cast<void>(ended_.load(std::memory_order_acquire));
    const ForkTeam::Member member(&team_, helpers_.fetch_add(1, std::memory_order_relaxed) + 1);
    team_.WorkUntil(done_, 1);
    ended_.fetch_add(1, std::memory_order_release);
  }

  const int num_workers_;
  const std::function<void()>& work_;
  bool begun_ = false;
  std::atomic<int> helpers_{0}, done_{0};
  ForkTeam team_;
  // Orders caller before helpers before caller. TBB does so too, but its library is not instrumented: this lets the
  // thread sanitizer see that order, and no other, so that a race between two tasks is still found.
  std::atomic<int> ended_{0};
  std::exception_ptr exception_;
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

void WorkerPool::Together(const std::function<void()>& work) {
  if (impl_->num_workers == 1 || ForkTeam::Of(impl_.get()))
    return work();  // nothing to share: no TBB, not even the user's arena
  Run run(impl_->num_workers, impl_.get(), work);
  if (impl_->enter) {
    impl_->enter([&run] { run.WorkInArena(); });
  } else {
    impl_->arena->execute([&run] { run.WorkInArena(); });
  }
  run.Finish();
}

void WorkerPool::ForEach(int num_tasks, const Task& task) { RunAll(num_tasks, true, task); }

void WorkerPool::ForPieces(int num_pieces, const Task& run) { RunAll(num_pieces, false, run); }

void WorkerPool::RunAll(int count, bool in_order, const Task& task) {
  if (count <= 0) return;
  thread_local const Impl* in_task = nullptr;
  if (in_task == impl_.get()) throw std::logic_error("WorkerPool: a task calls the pool that runs it");
  FirstException first_exception;
  const auto guarded = [&](int index) {
    const Impl* const outer = std::exchange(in_task, impl_.get());
    try {
      task(index, ForkTeam::Worker());
    } catch (...) {
      first_exception.Catch(index);
    }
    in_task = outer;
  };
  if (impl_->num_workers == 1) {
    const ForkTeam::Member alone(nullptr, 0);
    for (int index = 0; index < count; ++index) guarded(index);
  } else {
    const auto all = [&] {
      in_order ? ForkTeam::Of(impl_.get())->ForEach(count, guarded) : Fork(count, guarded, From::kBothEnds);
    };
    Together(std::cref(all));
  }
  first_exception.Rethrow();
}

}  // namespace islet::parallel
