// Angular momentum and kinetic energy of a few bodies, and how to get them back after somebody has shifted the bodies: a
// correction of positions is no motion, and must not make one.
//   threads: pure functions
#pragma once

#include <span>

#include "engine/body.h"

namespace islet {

struct IslandSpin {
  Vector3 point_W = Vector3::Zero();             // [m] where the centre of mass of all was
  Vector3 angular_momentum_W = Vector3::Zero();  // [N m s] about that point, which flying on does not change
  double scale = 0;                              // [N m s] sizes of its parts
  double energy = 0;                             // [J]
};

// members: places in `bodies`, all of them dynamic.
IslandSpin SpinOf(std::span<const int> members, std::span<const Body> bodies);

// Turns the velocities about the common centre, so that the angular momentum is `before`'s, and scales what the bodies move
// relative to each other, so that the energy is. The linear momentum stays.
void RestoreSpin(const IslandSpin& before, std::span<const int> members, std::span<Body> bodies);

}  // namespace islet
