// The command `islet view --live`: a scene that runs while a page in a browser looks at it and plays with it. Returns when interrupted.
//
//   A step takes as long as it lasts in the scene, or longer: what is late is not caught up. Of the steps at most 60 a second are shown.
//   errors: as MakeReady; std::runtime_error where the port cannot be had, std::invalid_argument where the bodies are at no place any more
#pragma once

#include "scenes/run_options.h"

namespace islet {

void ViewLive(const RunOptions& options);

}  // namespace islet
