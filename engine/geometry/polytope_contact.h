// Hull against hull and box against hull: separating axes over the faces of both and over those pairs of edges that
// meet on the Gauss map, then the same manifold as for boxes.
//
// See narrow_phase.h for what the contacts promise, separating_axis.h for the choice of the axis.
//   cost: linear in the features of both, but for the few edges along whose arcs they may be farther apart than along any
//     face
//   threads: pure; scratch memory is one per thread
#pragma once

#include <vector>

#include "engine/geometry/narrow_phase.h"

namespace islet {

void CollidePolytopes(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b, double reach,
                      std::vector<Contact>* contacts);

}  // namespace islet
