// Nearest points of polytopes: exact, by looking at features, for shapes of up to some hundred corners.
//
//   frames: each function says which; a caller that mixes bodies gives the pose of b in a's frame
//   threads: pure functions; scratch memory is one per thread
#pragma once

#include "engine/shape.h"

namespace islet {

struct NearestPoint {
  Vector3 point_B;   // [m] on the surface
  Vector3 normal_B;  // unit; from the point to the query outside, the face's normal inside and on the surface
  double distance;   // [m] negative inside: depth under the nearest face
};

// `size` is that of the shape: closer than 1e-9 of it counts as on the surface.
NearestPoint NearestOnPolytope(const Polytope& polytope, double size, const Vector3& query_B);

struct ClosestPoints {
  Vector3 on_a, on_b;  // [m] in a's frame
  double distance;     // [m]
  int feature;         // which features met: 0.. corners of a, then corners of b, then pairs of edges
};

// Of two polytopes that the unit direction n (in a's frame, from a to b) separates by `separation` >= 0.
ClosestPoints ClosestOfApart(const Polytope& a, double size_a, const Polytope& b, double size_b,
                             const Matrix3& rotation_ab, const Vector3& position_ab, const Vector3& n,
                             double separation);

}  // namespace islet
