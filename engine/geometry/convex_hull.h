// Points -> the polytope around them, by gift wrapping: each face is found whole, with every point of its plane, so
// that coplanar points make one polygon and never slivers.
//
//   in:  points in any order, duplicates and inner points allowed      out: a closed polytope, in the points' frame
//   cost: faces x points; meant for shapes (up to some thousand points), not for clouds
//   order: vertices keep the order of the points; the result depends on the points alone
//   errors: std::invalid_argument for fewer than four points, a coordinate that is not finite, points in one plane, more than 4,096 faces
//           or 100,000 points
#pragma once

#include <span>

#include "engine/shape.h"

namespace islet {

// Points that are closer to a face than 1e-5 of the extent, or 1e-3 of the thickness if that is less, lie in it. Those that near to each other are one.
Polytope BuildConvexHull(std::span<const Vector3> points);

}  // namespace islet
