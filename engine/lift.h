// What corrections of overlaps owe for the height that they give to bodies in the air. Two bodies that overlap at the end of a
// step have met before it; a correction puts them where they do not overlap and knows of no velocity. One that it lifts would
// have the height for nothing. An island that leans on nothing keeps its centre, and so its height; one that leans on a wall
// does not, and pays:
//
//   pushes    what corrected acts on the velocities too, scaled by one number for all that corrections joined in this step, so
//             that the kinetic energy is less by what the height took, or more by what a fall gave. So momentum goes where
//             contacts could take it, into the bodies and into the wall. It is as if the bodies had met at another speed
//   the rest  what no pushes can pay, since too little moves along them, is taken from the velocities of those that owe, all
//             alike, down to rest at most: nobody goes below
//   who owes  bodies that no contact supports in this step. What is supported owes nothing: a pile that is parted by a hair
//             must come to rest. Islands that do not bounce nearly elastically are not asked at all (motion.cpp)
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

// What corrections joined, and what they did to it.
struct Lift {
  std::span<const int> members;               // places in `bodies`, `owes` and `corrections`
  std::span<const std::uint8_t> owes;         // per body
  std::span<const Displacement> corrections;  // per body
  double turn_weight = 1;                     // turns were more expensive than in the mass metric by this
  bool leans = true;                          // on something immovable
};

// Changes the members' velocities by what is owed. Returns the momentum [N s] that they got from what they lean on.
Vector3 PayForLift(const Vector3& gravity_W, const Lift& lift, std::span<Body> bodies);

}  // namespace islet
