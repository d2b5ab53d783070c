// What a user is asked before two bodies may touch: one-way platforms, a projectile and who threw it.
#pragma once

#include <functional>

#include "engine/body.h"

namespace islet {

// Whether bodies a < b may touch in this step: false lets them go through each other. The bodies are as the step found them, and it may be
// asked of a pair any number of times, from any thread: it must depend on its arguments alone.
using CollisionCallback = std::function<bool(int a, int b, const Body& body_a, const Body& body_b)>;

}  // namespace islet
