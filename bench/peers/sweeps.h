// Settings of a line that sweeps dt, and of one that sweeps iterations. `start` has the rest.
#pragma once

#include <span>
#include <vector>

#include "bench/peers/peer.h"

namespace islet::peers {

void AddTimeSteps(Setting start, std::span<const int> per_second, std::span<const int> quick_per_second,
                  std::vector<Setting>* settings);
void AddIterations(Setting start, std::span<const int> iterations, std::span<const int> quick_iterations,
                   std::vector<Setting>* settings);

}  // namespace islet::peers
