// Box against box: fifteen axes, then either the clipped manifold of two faces or the point of two edges.
//
// See narrow_phase.h for what the contacts promise, separating_axis.h for the choice of the axis.    threads: pure
#pragma once

#include <vector>

#include "engine/geometry/narrow_phase.h"

namespace islet {

void CollideBoxBox(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                   std::vector<Contact>* contacts, std::int8_t* separating);

}  // namespace islet
