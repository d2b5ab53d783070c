#include "engine/rotation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "qp/elementary.h"
#include "qp/smallness.h"

namespace islet {
namespace {

constexpr double kMostParts = 256;  // of a step; a body that spins faster than that may lose the exact energy
// Five midpoint steps of these shares of the time, the third one backwards, are right to fourth order.      [Suz90]
constexpr double kShare = 0.41449077179437571;  // 1 / (4 - 4^(1/3))
constexpr double kShares[] = {kShare, kShare, 1 - 4 * kShare, kShare, kShare};

bool IsIsotropic(const Matrix3& inertia) {
  const double mean = inertia.trace() / 3;
  return (inertia - mean * Matrix3::Identity()).cwiseAbs().maxCoeff() < 1e-14 * mean;
}

// The turn of a symmetric top, in B: about its angular momentum as fast as its axis does, and about that axis by the rest.
Quaternion TopTurn(const Matrix3& inertia, int axis, const Vector3& w, double dt) {
  const Vector3 rate = inertia * w / inertia((axis + 1) % 3, (axis + 1) % 3);
  return Exp(dt * rate) * Exp(dt * (w[axis] - rate[axis]) * Vector3::Unit(axis));
}

// The midpoint angular velocity w solves I w + dt/2 w x I w = L, everything in B.
Vector3 MidpointVelocity(const Matrix3& inertia, const Matrix3& inverse, const Vector3& momentum, double dt) {
  Vector3 w = inverse * momentum;
  for (int i = 0; i < 20; ++i) {
    const Vector3 p = inertia * w;
    const Vector3 residual = p + 0.5 * dt * w.cross(p) - momentum;
    const Matrix3 slope = inertia + 0.5 * dt * (CrossMatrix(w) * inertia - CrossMatrix(p));
    const Vector3 change = slope.inverse() * residual;
    w -= change;
    if (change.squaredNorm() <= kNegligible * kNegligible * w.squaredNorm()) break;  // the next one would be its square
  }
  return w;
}

// [rad] rotation vector in B, which the rotation leaves as it is.
Vector3 MidpointRotation(const Matrix3& inertia, const Matrix3& inverse, const Vector3& momentum_B, double dt) {
  const Vector3 w = MidpointVelocity(inertia, inverse, momentum_B, dt);
  const double speed = w.norm();
  if (speed == 0) return dt * w;  // the squares of what is below 1e-162 rad/s vanish
  return 2 * ArcTangent(0.5 * dt * speed) / speed * w;
}

}  // namespace

bool SymmetricAbout(const Matrix3& inertia_B, int axis) {
  const int i = (axis + 1) % 3, k = (axis + 2) % 3;
  const double rounding = 1e-14 * inertia_B.trace();
  return std::abs(inertia_B(i, i) - inertia_B(k, k)) < rounding && std::abs(inertia_B(i, k)) < rounding &&
         std::abs(inertia_B(i, axis)) < rounding && std::abs(inertia_B(k, axis)) < rounding;
}

Vector3 FreeRotation(const Matrix3& inertia_B, const Quaternion& rotation_WB, const Vector3& angular_velocity_W,
                     double dt) {
  if (angular_velocity_W.isZero(0)) return Vector3::Zero();
  if (IsIsotropic(inertia_B)) return dt * angular_velocity_W;
  for (int axis = 0; axis < 3; ++axis)
    if (SymmetricAbout(inertia_B, axis))
      return rotation_WB * Log(TopTurn(inertia_B, axis, rotation_WB.conjugate() * angular_velocity_W, dt));
  const Matrix3 inverse = inertia_B.inverse();
  const Vector3 momentum_B = inertia_B * (rotation_WB.conjugate() * angular_velocity_W);
  const double turn = dt * angular_velocity_W.norm();
  // Newton's steps need a turn of about a radian at most.
  const int parts = static_cast<int>(std::clamp(std::ceil(turn / kLargestTurn), 1.0, kMostParts));
  Quaternion turned_B = Quaternion::Identity();  // what the body has turned by so far, seen from where it began
  for (int i = 0; i < parts; ++i) {
    for (const double share : kShares) {
      const Vector3 momentum = turned_B.conjugate() * momentum_B;
      turned_B = (turned_B * Exp(MidpointRotation(inertia_B, inverse, momentum, share * dt / parts))).normalized();
    }
  }
  return rotation_WB * Log(turned_B);
}

Quaternion Exp(const Vector3& v) {
  const double angle = v.norm(), share = angle > 0 ? Sine(0.5 * angle) / angle : 0.5;
  return Quaternion(Cosine(0.5 * angle), share * v.x(), share * v.y(), share * v.z());
}

Matrix3 TurnLessOne(const Vector3& v) {
  const Quaternion q = Exp(v);
  const Matrix3 cross = CrossMatrix(q.vec());
  return 2 * (q.w() * cross + cross * cross);
}

Vector3 Log(const Quaternion& q) {
  const double sign = q.w() < 0 ? -1 : 1;
  const double sine = q.vec().norm();
  const double share = sine > 1e-9 ? 2 * ArcTangent(sine, sign * q.w()) / sine : 2.0;
  return sign * share * q.vec();
}

Vector3 AngularVelocityAfter(const Matrix3& inertia_B, const Quaternion& rotation_WB, const Vector3& angular_velocity_W,
                             const Quaternion& rotation_new_WB) {
  if (IsIsotropic(inertia_B)) return angular_velocity_W;
  const Vector3 momentum_W = rotation_WB * Vector3(inertia_B * (rotation_WB.conjugate() * angular_velocity_W));
  const Vector3 momentum_B = rotation_new_WB.conjugate() * momentum_W;
  return rotation_new_WB * Vector3(inertia_B.inverse() * momentum_B);
}

}  // namespace islet
