// What of a turn a shape shows. A capsule or cylinder that turns about its axis, as one that rolls does, is where it was: its surface
// goes with the axis alone. (Spheres and half-spaces show no turn at all; who calls knows them.)
//
//   frames: W    units: SI    threads: pure functions
#pragma once

#include "engine/linear_algebra.h"
#include "engine/shape.h"

namespace islet::motion {

// Of shapes with an axis: what the two below say of them.
Vector3 SpinOfAxis(const Quaternion& rotation_WB, const Vector3& spin_W);
Quaternion RotationOfAxis(const Quaternion& from_WB, const Quaternion& to_WB);

// [rad/s] without its part about the axis.
inline Vector3 VisibleSpin(const Shape& shape, const Quaternion& rotation_WB, const Vector3& spin_W) {
  return shape.HasAxis() ? SpinOfAxis(rotation_WB, spin_W) : spin_W;
}

// The rotation that has the shape where `to` has it, by the shortest turn of the axis.
inline Quaternion VisibleRotation(const Shape& shape, const Quaternion& from_WB, const Quaternion& to_WB) {
  return shape.HasAxis() ? RotationOfAxis(from_WB, to_WB) : to_WB;
}

}  // namespace islet::motion
