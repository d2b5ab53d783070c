// The option --effort: quick, normal, thorough, or so many sweeps (with Newton's method as by normal).
//   errors: std::invalid_argument that names the option and its value
#pragma once

#include <string>

#include "engine/settings.h"

namespace islet {

Effort ParseEffort(const std::string& text);
std::string NameOf(const Effort& effort);  // that ParseEffort reads

// Of the option --tier, which --effort took the place of: says so on the standard error, and changes nothing.
void NoteTier(const std::string& value);

inline constexpr const char* kEffortHelp =
    "coulomb: most work for an island: quick, normal, thorough, or so many sweeps (default normal)";

}  // namespace islet
