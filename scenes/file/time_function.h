// A number that depends on time: constant, a table with straight lines between its rows, or a sine.
//   units: those of what it drives; time in s from the start of the run      threads: pure
#pragma once

#include <array>
#include <vector>

#include "engine/linear_algebra.h"

namespace islet {

struct TimeFunction {
  double constant = 0;
  std::vector<std::array<double, 2>> table;  // (time, value), times ascending; before and behind it the nearest row's
  double amplitude = 0, frequency = 0, phase = 0;  // of the sine: [Hz], [rad]

  double At(double time) const;  // constant + table + amplitude sin(2 pi frequency time + phase)
};

using TimeVector = std::array<TimeFunction, 3>;
Vector3 At(const TimeVector& functions, double time);

}  // namespace islet
