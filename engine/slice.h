// One piece of work of a step, told when it has ended: for traces that show where time goes. For the whole process, as profilers are.
//
//   threads: an observer is called by the thread that did the work, by several at once; it must not throw nor touch a world
//   cost: without an observer one load of a pointer a piece; no result depends on what it is told
#pragma once

#include <atomic>
#include <functional>

namespace islet {

// What took how long. Slices of one thread nest: what lies in the time of another is a part of it.
//   "collision_qp", "static_qp"   one problem of an island, as counted in StepReport::collision_qp and static_qp
//   "detect"                      contacts of a crowd found, or those of bodies that came since the last step
//   "solve"                       all problems of a crowd, on all workers
//   "groups", "crowd", "ledger"   what a step consists of: small groups moved, the crowd moved, both judged
struct Slice {
  const char* name = "";
  double begin = 0, end = 0;  // [s] of stopwatch.h
  int body = -1;              // of an island: its smallest body; -1: of no island
  int contacts = 0;           // of its problem
};

using SliceObserver = std::function<void(const Slice& slice)>;

inline std::atomic<const SliceObserver*> slice_observer = nullptr;  // null: nobody is told

inline void TellSlice(const Slice& slice) {
  if (const SliceObserver* const observer = slice_observer.load(std::memory_order_acquire)) (*observer)(slice);
}

// A stage that is told is counted, too: from begin to end, both in [s] of stopwatch.h.
inline void CountStage(const char* name, double begin, double end, double* seconds) {
  *seconds += end - begin;
  TellSlice({name, begin, end});
}

}  // namespace islet
