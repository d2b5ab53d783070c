// Pieces of one task side by side: for work inside an island, while the other islands leave workers idle.
//
// A task of a WorkerPool may fork over the workers of its pool that have run out of tasks of their own; anywhere else the
// pieces run one after the other in the calling thread. A thread that waits for its pieces helps with pieces only, it
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

// How many threads may work on the calling task, >= 1.
int ForkWidth();

// piece(i) for i = 0 .. num_pieces-1, started in this order; returns when all are done. Pieces must not throw.
void Fork(int num_pieces, PieceRef piece);

// Both, then returns.
template <typename First, typename Second>
void ForkTwo(const First& first, const Second& second) {
  Fork(2, [&](int piece) { piece == 0 ? first() : second(); });
}

// run(first, last) for consecutive ranges of kAtOnce numbers that cover 0 .. count-1.
template <typename Run>
void ForkRanges(int count, const Run& run) {
  Fork((count + kAtOnce - 1) / kAtOnce,
       [&](int piece) { run(piece * kAtOnce, std::min(count, (piece + 1) * kAtOnce)); });
}

// The workers of one call of WorkerPool::ForEach. Used by WorkerPool alone.
class ForkTeam {
 public:
  explicit ForkTeam(int width) : width_(width) {}

  // While one lives, forks of this thread are shared with the team.
  class Member {
   public:
    explicit Member(ForkTeam* team);
    ~Member();
    Member(const Member&) = delete;
    Member& operator=(const Member&) = delete;

   private:
    ForkTeam* outer_;
  };

  // Takes up pieces of others until `done` equals `target`.
  void HelpUntil(const std::atomic<int>& done, int target);

 private:
  friend int ForkWidth();
  friend void Fork(int, PieceRef);
  struct Job {
    PieceRef piece;
    int count;
    int next;  // guarded by the mutex
    std::atomic<int> done{0};
    Job* before;  // list of the jobs with pieces left, latest first; guarded by the mutex
  };
  void Run(Job* job);
  bool TakePiece(Job* job, int* piece);
  bool HelpOnce();

  const int width_;
  std::mutex mutex_;
  std::atomic<Job*> latest_{nullptr};
};

}  // namespace islet::parallel
