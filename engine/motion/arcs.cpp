#include "engine/motion/arcs.h"

#include <Eigen/Cholesky>

#include "engine/motion/lever.h"
#include "engine/rotation.h"
#include "qp/smallness.h"

namespace islet::motion {
namespace {

// From an arm [m] to the velocity [m/s] of the chord of its end, which turns around the origin for this long [s] from now on, or until now if that
// is negative.
Matrix3 ChordOf(const Vector3& angular_velocity_W, double duration) {
  if (duration == 0) return CrossMatrix(angular_velocity_W);
  const Quaternion turn = Exp(duration * angular_velocity_W);
  const Matrix3 half = CrossMatrix(turn.vec());
  return 2 / duration * (turn.w() * half + half * half);
}

// [m/s] by which a wall goes around a centre that goes evenly, if the step before lasted so long [s].
Vector3 Around(const Body& wall, double dt, double before) {
  const Matrix3 to_chord = ChordOf(wall.angular_velocity_W, dt),
                to_change = to_chord - ChordOf(wall.angular_before_W, -before);
  // How far it is along the axis is known only where the axis turns, too; else it is taken for nothing.
  const Vector3 axis = wall.angular_velocity_W.normalized();
  const Matrix3 known = to_change.transpose() * to_change + 1e-6 * to_change.squaredNorm() * axis * axis.transpose();
  const Vector3 change_W = wall.linear_velocity_W - wall.linear_before_W;
  return to_chord * known.ldlt().solve(to_change.transpose() * change_W);
}

}  // namespace

void Arcs::Begin(double dt, double before, std::span<Body> bodies) {
  dt_ = dt;
  walls_.clear();
  for (size_t i = 0; i < bodies.size(); ++i) {
    Body& b = bodies[i];
    if (!IsTurningWall(b) || b.removed || b.linear_velocity_W == b.linear_before_W) continue;
    const Quaternion turn = Exp(dt * b.angular_velocity_W);
    if (turn.vec().norm() <= kNegligible) continue;  // rounding of a pose turns nothing
    if (turn.w() < 0.5) continue;                    // more than a third of a circle in a step is no arc
    Vector3 around_W = Around(b, dt, before);
    if (before == 0) {  // given may be the velocity of a point, or that of a chord: the one whose centre goes slower
      const Vector3 of_chord_W = Around(b, dt, dt);
      const auto centre = [&](const Vector3& around) { return (b.linear_velocity_W - around).norm(); };
      if (centre(of_chord_W) < centre(around_W)) around_W = of_chord_W;
    }
    b.arc_W = 2 / (dt * turn.w()) * turn.vec().cross(around_W);
    walls_.push_back({static_cast<int>(i), b.linear_velocity_W, b.arc_W});
  }
}

void Arcs::Follow(double t, double duration, std::span<Body> bodies) const {
  for (const Wall& wall : walls_) {
    bodies[wall.body].linear_velocity_W = wall.velocity_W + (t + 0.5 * duration - 0.5 * dt_) * wall.arc_W;
    bodies[wall.body].arc_W = wall.arc_W;
  }
}

void Arcs::End(std::span<Body> bodies) {
  for (const Wall& wall : walls_) bodies[wall.body].linear_velocity_W = wall.velocity_W;
  for (Body& b : bodies) {
    b.linear_before_W = b.linear_velocity_W;
    b.beyond_before_W = 0.5 * dt_ * b.arc_W;
    b.angular_before_W = b.angular_velocity_W;
    b.surface_before_B = b.surface_velocity_B;
    b.arc_W.setZero();
  }
  walls_.clear();
}

}  // namespace islet::motion
