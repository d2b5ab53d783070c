// What corrections of overlaps owe for the height that they give to bodies in flight. Two bodies that overlap at the end of a
// step have met before it; a correction puts them where they do not overlap and knows of no velocity. One that it lifts would
// have the height for nothing. An island that touches nothing immovable keeps its centre, and so its height; one that leans on
// something does not, and pays:
//
//   pushes   what corrected acts on the velocities too, scaled by one number s [1/s] for the island, so that kinetic energy
//            becomes what the work of gravity and external forces leaves of it. So momentum goes where contacts could take it:
//            into the bodies and into what the island leans on. It is as if the bodies had met earlier, and slower
//   the rest what no pushes can pay (nothing approaches along them) is taken from all velocities alike, down to rest at most
//   who      bodies that no contact pushes in this step. What is supported neither pays nor gets anything: a pile that is
//            parted by a hair must come to rest
//
//   threads: pure functions
#pragma once

#include <cstdint>
#include <span>

#include "engine/body.h"

namespace islet {

struct Displacement {
  Vector3 linear = Vector3::Zero();   // [m]
  Vector3 angular = Vector3::Zero();  // [rad] rotation vector, W
};

// members: places in `bodies`, `pays` and `corrections`; only those that pay count. turn_weight: by how much the correction
// made turns more expensive than the mass metric does. Returns s.
double PayForLift(const Vector3& gravity_W, std::span<const int> members, std::span<const std::uint8_t> pays,
                  std::span<const Displacement> corrections, double turn_weight, std::span<Body> bodies);

}  // namespace islet
