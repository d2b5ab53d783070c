#include "engine/motion/arcs.h"

#include <Eigen/Cholesky>

#include "engine/motion/lever.h"
#include "engine/rotation.h"

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

}  // namespace

void Arcs::Begin(double dt, double before, std::span<Body> bodies) {
  dt_ = dt;
  walls_.clear();
  for (size_t i = 0; i < bodies.size(); ++i) {
    Body& b = bodies[i];
    const Vector3 change_W = b.linear_velocity_W - b.linear_before_W;
    if (!IsTurningWall(b) || b.removed || change_W.isZero(0)) continue;
    const Quaternion turn = Exp(dt * b.angular_velocity_W);
    if (turn.w() < 0.5) continue;  // more than a third of a circle in a step is no arc
    const Matrix3 to_chord = ChordOf(b.angular_velocity_W, dt);
    const Vector3 axis = b.angular_velocity_W.normalized();
    const auto chord_if = [&](double lasted) -> Vector3 {
      const Matrix3 to_change = to_chord - ChordOf(b.angular_before_W, -lasted);
      // How far it is along the axis is known only where the axis turns, too; else it is taken for nothing.
      const Matrix3 known =
          to_change.transpose() * to_change + 1e-6 * to_change.squaredNorm() * axis * axis.transpose();
      return to_chord * known.ldlt().solve(to_change.transpose() * change_W);
    };
    Vector3 chord_W = chord_if(before);
    if (before == 0) {  // given may be the velocity of a point, or of a chord: as its centre goes slower
      const Vector3 other_W = chord_if(dt);
      if ((b.linear_velocity_W - other_W).norm() < (b.linear_velocity_W - chord_W).norm()) chord_W = other_W;
    }
    b.arc_W = 2 / (dt * turn.w()) * turn.vec().cross(chord_W);
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
