// Pieces of one task side by side: for work inside an island, while the other islands leave workers idle.
//
// Whoever works for a WorkerPool may fork over the workers of the pool that have run out of tasks of their own; anywhere else
// the pieces run one after the other in the calling thread. A thread that waits for its pieces helps with pieces only, it
// never starts another task. Which thread runs which piece depends on timing: pieces write to places of their own, and
// whoever forks puts their results together in the order of their numbers.
//   threads: from any task; forks may be nested; no allocation
#pragma once

#include <algorithm>
#include <atomic>
#include <mutex>
#include <type_traits>

#include "parallel/schedule.h"

namespace islet::parallel {

// A piece of work by reference: what it points to must outlive the call it is handed to.
class PieceRef {
 public:
  template <typename F>
  requires(!std::is_same_v<std::remove_cvref_t<F>, PieceRef>)
      PieceRef(const F& function)  // NOLINT: implicit, as a lambda is handed over
      : object_(&function), call_([](const void* object, int piece) { (*static_cast<const F*>(object))(piece); }) {}
  void operator()(int piece) const { call_(object_, piece); }

 private:
  const void* object_;
  void (*call_)(const void*, int);
};

// Which piece is next.
enum class From {
  kFirst,  // in their order
  kBothEnds,  // the caller begins at the first and who helps at the last: of loops that follow each other a thread mostly gets the
              // same numbers, whose data it has at hand
};

// piece(i) for i = 0 .. num_pieces-1; returns when all are done. Pieces must not throw.
void Fork(int num_pieces, PieceRef piece, From from = From::kFirst);

// run(first, last) for ranges of `at_once` numbers that cover 0 .. count-1.
template <typename Run>
void ForkRanges(int count, const Run& run, int at_once = kAtOnce) {
  const auto range = [&](int piece) { run(piece * at_once, std::min(count, (piece + 1) * at_once)); };
  Fork((count + at_once - 1) / at_once, range, From::kBothEnds);
}

// The workers of one call of WorkerPool. Used by WorkerPool alone.
class ForkTeam {
 public:
  // of: the pool.
  explicit ForkTeam(const void* of) : of_(of) {}

  // While one lives, forks of this thread are shared with the team.
  class Member {
   public:
    Member(ForkTeam* team, int worker);
    ~Member();
    Member(const Member&) = delete;
    Member& operator=(const Member&) = delete;

   private:
    ForkTeam* outer_;
    int outer_worker_;
  };

  // The team of that pool that this thread works in, or null.
  static ForkTeam* Of(const void* pool);
  // Of this thread.
  static int Worker();

  // task(i) for i = 0 .. count-1, started in this order. Who waits for pieces of a task takes up no other one.
  void ForEach(int count, PieceRef task);

  // Takes up tasks, and pieces of others, until `done` equals `target`.
  void WorkUntil(const std::atomic<int>& done, int target) { HelpUntil(done, target, true); }

 private:
  friend void Fork(int, PieceRef, From);
  struct Job {
    PieceRef piece;
    int count;
    From from = From::kFirst;
    int next = 0, last = count;  // what is left; guarded by the mutex
    std::atomic<int> done{0};
    Job* before = nullptr;  // list of the jobs with pieces left, latest first; guarded by the mutex
  };
  void Run(Job* job);
  bool TakePiece(Job* job, int* piece);
  bool TakeTask(Job** job, int* piece);
  bool HelpOnce(bool tasks_too);
  void HelpUntil(const std::atomic<int>& done, int target, bool tasks_too);

  const void* const of_;
  std::mutex mutex_;
  std::atomic<Job*> latest_{nullptr}, tasks_{nullptr};
};

}  // namespace islet::parallel
