// Step 4 as the paper has it: who counts as stationary, and for how long.                       [SM04 Sec. 5.2, Eq. 15]
//
//   in:  plain arrays, one entry per body; no pose, no impulse is seen here
//   out: counters and frozen flags, updated in place
//   A body counts up in every frame in which its kinetic energy is below that of a fall from rest through one step and it
//   touches a fixed or frozen body; else it starts again. When the counter exceeds c_f it freezes.
//   threads: pure functions
#pragma once

#include <cstdint>
#include <span>

namespace islet::islands {

struct StillnessInput {
  std::span<const double> kinetic_energy;  // [J]
  std::span<const double> threshold;       // [J] p_g^2 / (2 m), p_g = m g dt                          [SM04 Eq. 15]
  std::span<const std::uint8_t> touches_still;  // touches a fixed or frozen body
  std::span<const std::uint8_t> may_freeze;     // dynamic, and inside a cold volume
};

void UpdateFreezing(const StillnessInput& input, int freeze_count, std::span<int> counters,
                    std::span<std::uint8_t> frozen);

}  // namespace islet::islands
