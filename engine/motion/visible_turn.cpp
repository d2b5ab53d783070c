#include "engine/motion/visible_turn.h"

namespace islet::motion {

Vector3 SpinOfAxis(const Quaternion& rotation_WB, const Vector3& spin_W) {
  const Vector3 axis = rotation_WB * Vector3::UnitZ();
  return spin_W - axis.dot(spin_W) * axis;
}

Quaternion RotationOfAxis(const Quaternion& from_WB, const Quaternion& to_WB) {
  return Quaternion::FromTwoVectors(from_WB * Vector3::UnitZ(), to_WB * Vector3::UnitZ()) * from_WB;
}

}  // namespace islet::motion
