// What of a turn a shape shows. A capsule or cylinder that turns about its axis, as one that rolls does, is where it was: its surface
// goes with the axis alone. (Spheres and half-spaces show no turn at all; who calls knows them.)
//
//   frames: W    units: SI    threads: pure functions
#pragma once

#include "engine/linear_algebra.h"
#include "engine/shape.h"

namespace islet::motion {

// [rad/s] without its part about the axis.
inline Vector3 VisibleSpin(const Shape& shape, const Quaternion& rotation_WB, const Vector3& spin_W) {
  if (!shape.HasAxis()) return spin_W;
  const Vector3 axis = rotation_WB * Vector3::UnitZ();
  return spin_W - axis.dot(spin_W) * axis;
}

// The rotation that has the shape where `to` has it, by the shortest turn of the axis.
inline Quaternion VisibleRotation(const Shape& shape, const Quaternion& from_WB, const Quaternion& to_WB) {
  if (!shape.HasAxis()) return to_WB;
  return Quaternion::FromTwoVectors(from_WB * Vector3::UnitZ(), to_WB * Vector3::UnitZ()) * from_WB;
}

}  // namespace islet::motion
