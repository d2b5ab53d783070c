// Capsules and cylinders against everything: their own faces, curves and points, not a hull around them.
//
// What two convex bodies meet with is a face of one, or two curves that cross, or points: each gives a direction n, and the gap is the
// largest, over these directions, of the separation along n. It is exact to round-off, apart and in overlap. Beside the nearest points a
// pair that lies flat gets the corners of what they share, so that it stands.
//   normals: n, but where two long sides lie along each other each end has its own
//   threads: pure functions; scratch memory is one per thread
#pragma once

#include <vector>

#include "engine/geometry/narrow_phase.h"

namespace islet {

// Sine: a face that is as far off the plane of contact may lie flat, and two long sides as far off each other lie beside each other.
inline constexpr double kLevel = 0.3;

void CollideHalfSpaceRound(const Placement& half_space, const Shape& shape, const Placement& pose, double reach,
                           std::vector<Contact>* contacts);
// One of the shapes at least is a capsule or cylinder; none is a half-space.
void CollideRound(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                  std::vector<Contact>* contacts);

}  // namespace islet
