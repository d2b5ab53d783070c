// Runs one scene as the options say and writes its outputs: the command `islet run` without the reading of its options.
#pragma once

#include <functional>
#include <string>

#include "engine/world.h"
#include "scenes/run_options.h"

namespace islet {

// Without frames or seconds a scene stops at rest or at its time limit. At rest means: all dynamic bodies are frozen,
// or, with freezing off, none had more than 1e-8 J/kg of kinetic energy (0.14 mm/s) for half a second; and no kinematic
// body has a velocity.
// An interrupt (interrupt.h) ends it after the frame under way; what was asked for is written as at any other end.
//   out:    why it ended: "frames", "seconds", "rest" or "time limit"; "watch" if the watch said so. How many steps failed, of which the
//           standard error tells in a line at the end
//   watch:  sees the world before the first step, as frame 0, and after each; false: the run ends there. With one nothing is printed but
//           progress, and no file is written.
//   errors: std::invalid_argument for a value out of range, before any file is touched; std::runtime_error for outputs that could not be
//           written, a line for each: those of which it shows before the first step end the run there, of the others all else is written first
struct RunEnd {
  std::string stopped_by;
  int failed_steps = 0;  // StepReport::Failed(); with a watch not counted
};
using RunWatch = std::function<bool(const World& world, int frame)>;
RunEnd RunScene(const RunOptions& options, const RunWatch& watch = {});

}  // namespace islet
