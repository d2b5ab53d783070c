// Freezing as in the paper: a body whose kinetic energy has been below that of a step of free fall for some frames, and that touches
// what stands still.                                                                              [SM04 Sec. 5.2, Eq. 15]
#pragma once

#include <vector>

#include "engine/response/suite_frame.h"
#include "engine/settings.h"

namespace islet {

// counters: per body, frames at low energy so far. A body that freezes loses its velocity.
void FreezeLikePaper(const SuiteFrame& frame, const Settings& settings, std::vector<int>* counters);

}  // namespace islet
