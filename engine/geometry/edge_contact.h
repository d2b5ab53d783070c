// Two edges that lie on each other, or a corner on a corner or on an edge, of faces that do not: such bodies part along any direction between
// the normals of these faces. None of the faces is at fault, so what presses acts halfway between: what is symmetric stays so.
//
//   threads: pure
#pragma once

#include <vector>

#include "engine/geometry/narrow_phase.h"

namespace islet {

inline constexpr double kTouch = 1e-5;  // of a size: twice what gaps may miss
inline constexpr double kAngle = 1e-2;  // [rad] between sides; those nearer than that are alike

// Appends the point of a corner, or the ends of what two edges share, with one normal. normal_W, separation: of the axis that keeps the
// bodies farthest apart. False where they do not touch, or by faces.
bool AppendTouchingFeatures(const Shape& a, const Placement& pose_a, const Shape& b, const Placement& pose_b,
                            const Vector3& normal_W, double separation, double size, std::vector<Contact>* contacts);

}  // namespace islet
