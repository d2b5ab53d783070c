// Where a ray enters a shape.
//   threads: pure functions
#pragma once

#include <optional>

#include "engine/geometry/narrow_phase.h"
#include "engine/shape.h"

namespace islet {

struct RayEntry {
  double share;      // of the way, in [0, 1]
  Vector3 normal_W;  // unit, outward; against the way where the ray begins inside
};

// Unit; of no way at all: up.
Vector3 Against(const Vector3& way);

// The first point of origin + s way, 0 <= s <= 1, that is in the shape. Where the ray begins inside, that is the origin.
std::optional<RayEntry> EnterShape(const Shape& shape, const Placement& pose, const Vector3& origin_W,
                                   const Vector3& way_W);

}  // namespace islet
