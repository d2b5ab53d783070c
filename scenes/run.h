// Runs one scene as the options say and writes its outputs: the command `islet run` without the reading of its options.
#pragma once

#include "scenes/run_options.h"

namespace islet {

// Without frames or seconds a scene stops at rest or at its time limit. At rest means: all dynamic bodies are frozen,
// or, with freezing off, none had more than 1e-8 J/kg of kinetic energy (0.14 mm/s) for half a second.
// An interrupt (interrupt.h) ends it after the frame under way; what was asked for is written as at any other end.
//   errors: std::invalid_argument for a value out of range, before any file is touched
void RunScene(const RunOptions& options);

}  // namespace islet
