// The command line that makes a run again: all that chooses scene, time and method, nothing that only writes files.
#pragma once

#include <string>

#include "scenes/run_options.h"

namespace islet {

std::string CommandOf(const RunOptions& options);

}  // namespace islet
