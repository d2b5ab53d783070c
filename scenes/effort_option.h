// The option --effort: quick, normal, thorough, or so many sweeps (with Newton's method as by normal).
//   errors: std::invalid_argument that names the option and its value
#pragma once

#include <string>

#include "engine/settings.h"

namespace islet {

Effort ParseEffort(const std::string& text);
std::string NameOf(const Effort& effort);  // that ParseEffort reads

inline constexpr const char* kEffortHelp =
    "coulomb: most work for an island: quick, normal, thorough, or so many sweeps (default normal)";

}  // namespace islet
