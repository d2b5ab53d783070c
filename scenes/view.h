// The command `islet view`: a page of a scene, which it runs, or of what `islet run --record` kept.
//
//   With --live the page is served while the scene runs, see view_live.h.
//   errors: as RunScene; std::invalid_argument for a recording that is none or damaged, and for options of a run beside one
#pragma once

#include "scenes/run_options.h"

namespace islet {

void View(RunOptions options);

}  // namespace islet
