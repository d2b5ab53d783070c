// Rungs of the ladder that were tried and did not serve, and the time that took.
#pragma once

#include <array>
#include <cstddef>

#include "qp/ladder.h"

namespace islet::qp {

class InVain {
 public:
  int times(Rung rung) const { return times_[Index(rung)]; }         // that this rung was tried
  double seconds(Rung rung) const { return seconds_[Index(rung)]; }  // [s] that took
  int times() const;                                                 // of all rungs
  double seconds() const;                                            // [s] of all rungs

  void Add(Rung rung, double seconds, int times = 1);  // that a rung was tried, and the time [s] of all times together
  void Include(const InVain& other);                   // adds it up

 private:
  static constexpr std::size_t Index(Rung rung) { return static_cast<std::size_t>(rung); }

  std::array<int, kNumProblemRungs> times_{};
  std::array<double, kNumProblemRungs> seconds_{};
};

}  // namespace islet::qp
