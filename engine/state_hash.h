// A number that two runs share if and only if (up to chance) every pose, velocity and flag agrees bit for bit.
#pragma once

#include <cstdint>
#include <span>

#include "engine/body.h"

namespace islet {

std::uint64_t HashBodies(std::span<const Body> bodies);

}  // namespace islet
