#include "islands/freezing.h"

#include <cstddef>

namespace islet::islands {

void UpdateFreezing(const StillnessInput& input, int freeze_count, std::span<int> counters,
                    std::span<std::uint8_t> frozen) {
  for (std::size_t i = 0; i < counters.size(); ++i) {
    if (frozen[i]) continue;
    const bool still = input.may_freeze[i] && input.touches_still[i] && input.kinetic_energy[i] < input.threshold[i];
    counters[i] = still ? counters[i] + 1 : 0;
    if (counters[i] > freeze_count) frozen[i] = 1;
  }
}

}  // namespace islet::islands
