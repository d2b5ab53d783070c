// What of a turn a shape shows. A capsule or cylinder that turns about its axis, as one that rolls does, is where it was: its surface
// goes with the axis alone. Spheres show no turn at all.
//
//   frames: W    units: SI    threads: pure functions
#pragma once

#include <algorithm>

#include "engine/body.h"
#include "engine/linear_algebra.h"
#include "engine/motion/path.h"
#include "engine/rotation.h"
#include "engine/shape.h"

namespace islet::motion {

// Whether no turn of it shows.
inline bool TurnsInItself(const Shape& shape) { return shape.kind() == ShapeKind::kSphere; }

// [m] farthest point that a turn of it moves. That of a half-space is told by who is near (MeetingQuery).
inline double TurnRadius(const Shape& shape) {
  return TurnsInItself(shape) || shape.kind() == ShapeKind::kHalfSpace ? 0 : shape.radius();
}

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

// The way of a wall, and of a body that nothing turns. An axis circles the angular momentum at a constant rate, so it is exact for what has
// one, however fast. What has none goes on as it does as it begins.
inline Path FreePath(const Body& body, const Shape& shape, const State& from, const Vector3& half_acceleration_W) {
  Path path{from.pose, from.linear_W, half_acceleration_W, from.angular_W, Vector3::Zero(), TurnRadius(shape)};
  if (!shape.HasAxis()) return path;
  const Quaternion& rotation = from.pose.rotation_WB;
  const Vector3 visible = VisibleSpin(shape, rotation, from.angular_W);
  if (body.kind == BodyKind::kDynamic)
    path.rate_W =
        SymmetricAbout(body.inertia_B, 2)
            ? rotation * Vector3(body.inertia_B * (rotation.conjugate() * from.angular_W)) / body.inertia_B(0, 0)
            : visible;
  const double rate = path.rate_W.norm();
  if (rate > 0) path.shown = std::min(1.0, visible.norm() / rate);
  return path;
}

}  // namespace islet::motion
