// Rungs of the ladder that were tried and did not serve, and the time that took.
#pragma once

#include <array>
#include <cstddef>

#include "qp/ladder.h"

namespace islet::qp {

class InVain {
 public:
  int times(Rung rung) const { return times_[Index(rung)]; }
  double seconds(Rung rung) const { return seconds_[Index(rung)]; }
  int times() const;
  double seconds() const;

  void Add(Rung rung, double seconds, int times = 1);
  void Include(const InVain& other);

 private:
  static constexpr std::size_t Index(Rung rung) { return static_cast<std::size_t>(rung); }

  std::array<int, kNumProblemRungs> times_{};
  std::array<double, kNumProblemRungs> seconds_{};
};

}  // namespace islet::qp
