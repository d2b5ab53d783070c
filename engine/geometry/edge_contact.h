// Two edges, or two corners, that lie on each other, of faces that do not: such bodies part along any direction between the normals of these
// faces. None of the faces is at fault, so what presses acts halfway between: what is symmetric stays so.
//
//   threads: pure
#pragma once

#include <vector>

#include "engine/geometry/narrow_phase.h"

namespace islet {

// Appends one point of two corners, or the ends of what two edges share, with one normal. normal_W, separation: of the axis that keeps the
// bodies farthest apart. False where they do not touch, or by faces.
bool AppendTouchingFeatures(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                            const Vector3& normal_W, double separation, double size, std::vector<Contact>* contacts);

}  // namespace islet
