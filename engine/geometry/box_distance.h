// Nearest points of two boxes that are apart: what polytope_distance.h finds, in half the time.
//
//   frames: a's throughout; the features are numbered as there      threads: pure
#pragma once

#include "engine/geometry/polytope_distance.h"

namespace islet {

// See ClosestOfApart. Features farther apart than `limit` [m] are of no interest: the distance is infinite if all are.
ClosestPoints ClosestOfBoxes(const Shape& a, const Shape& b, const Matrix3& rotation_ab, const Vector3& position_ab,
                             const Vector3& n, double separation, double limit);

}  // namespace islet
