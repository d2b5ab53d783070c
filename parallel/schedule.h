// In which order tasks of known cost are to be started, and which are too small to be started alone.
//
// Starting the largest first is the classic bound on idle time: the last worker ends at most one task after the
// others, and that task is a small one. Tasks below a threshold are put together into batches of about that cost, since
// the counter and the call of a task cost a fraction of a microsecond and islands of one body are many.
//   in:  a cost per task, finite and >= 0, in any one unit (an estimate: never a measured time, or runs would differ)
//   out: a Schedule that depends on the costs alone; equal costs keep the order of their indices
//   threads: pure functions, safe from anywhere; no allocation once the vectors have grown
#pragma once

#include <cassert>
#include <cstddef>
#include <span>
#include <vector>

namespace islet::parallel {

// Of things that take 0.1 to 1 us each: enough to pay for a hand-over, and few enough to share what an island has.
inline constexpr int kAtOnce = 128;

// A piece of a loop over 0 .. count-1: kAtOnce of its numbers.
struct Range {
  std::size_t number;       // of this range
  std::size_t first, last;  // what it covers: first .. last-1
};
// How many ranges such a loop has.
constexpr std::size_t NumRanges(std::size_t count) { return (count + kAtOnce - 1) / kAtOnce; }

// Tasks in the order in which they are to be started, cut into batches.
struct Schedule {
  std::vector<int> order;        // every task once, largest cost first; of equal costs the smaller index first
  std::vector<int> batch_start;  // size num_batches() + 1; batch b runs order[batch_start[b] .. batch_start[b + 1])

  // One batch is one task of the pool.
  int num_batches() const { return batch_start.empty() ? 0 : static_cast<int>(batch_start.size()) - 1; }
  // The tasks of one batch, 0 <= index < num_batches().
  std::span<const int> batch(int index) const {
    assert(0 <= index && index < num_batches());
    const auto i = static_cast<std::size_t>(index);
    return std::span<const int>(order).subspan(static_cast<std::size_t>(batch_start[i]),
                                               static_cast<std::size_t>(batch_start[i + 1] - batch_start[i]));
  }
};

// A task of at least `batch_cost` is a batch of its own; smaller ones fill a batch until it has reached that cost, so
// no batch of several tasks costs twice as much. batch_cost = 0: one task each. Throws std::invalid_argument for a
// negative or non-finite cost. To run one: WorkerPool::ForEachByCost.
void MakeSchedule(std::span<const double> costs, double batch_cost, Schedule* schedule);

}  // namespace islet::parallel
