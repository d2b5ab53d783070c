#include "scenes/verify/check.h"

namespace islet {

std::span<const Check> FrictionChecks() { return {}; }

}  // namespace islet
