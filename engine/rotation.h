// Free rotation of a rigid body through one step, and rotation vectors.
//
// A body of which two principal moments are alike turns about its angular momentum and about its axis at constant rates: exact.
// Others: implicit midpoint rule on the body-frame Euler equations with the Cayley map: keeps |L| and the kinetic energy exactly
// (to rounding), for any inertia and any step; a step of more than half a radian is divided. Alone it is right to second
// order; five of them, one backwards, to fourth: 1e-7 of the turn at 5 rad/s and 1/60 s.          [Aus93, SW91, Suz90]
//   threads: pure functions
#pragma once

#include "engine/linear_algebra.h"

namespace islet {

// [rad] that is followed in one go: by free rotation, and in a piece of a step where something is near.
inline constexpr double kLargestTurn = 0.5;

// m x = r cross x.
inline Matrix3 CrossMatrix(const Vector3& r) {
  Matrix3 m;
  m << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
  return m;
}

// Whether two principal moments are alike and the third is about this axis of B, 0 to 2.
bool SymmetricAbout(const Matrix3& inertia_B, int axis);

// [rad] world rotation vector of the step from rotation_WB with angular velocity angular_velocity_W.
Vector3 FreeRotation(const Matrix3& inertia_B, const Quaternion& rotation_WB, const Vector3& angular_velocity_W,
                     double dt);

// exp of a rotation vector, as a unit quaternion.
Quaternion Exp(const Vector3& rotation_vector);
// exp of a rotation vector, as a matrix, less the identity: what it adds to a vector, without cancellation.
Matrix3 TurnLessOne(const Vector3& rotation_vector);
// Inverse of Exp, angle in [0, pi].
Vector3 Log(const Quaternion& rotation);

// [rad/s] after the body has turned to rotation_new_WB with its angular momentum kept.
Vector3 AngularVelocityAfter(const Matrix3& inertia_B, const Quaternion& rotation_WB, const Vector3& angular_velocity_W,
                             const Quaternion& rotation_new_WB);

}  // namespace islet
