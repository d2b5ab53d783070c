#include "scenes/verify/check.h"

namespace islet {

std::span<const Check> ImpactChecks() { return {}; }

}  // namespace islet
