#include "engine/motion/arcs.h"

#include <algorithm>

#include "engine/motion/lever.h"
#include "engine/rotation.h"

namespace islet::motion {

void Arcs::Begin(double dt, double before, std::span<Body> bodies) {
  dt_ = dt;
  walls_.clear();
  for (size_t i = 0; i < bodies.size(); ++i) {
    Body& b = bodies[i];
    if (!IsTurningWall(b) || b.removed) continue;
    const Vector3 &v = b.linear_velocity_W, half = 0.5 * dt * b.angular_velocity_W;
    // How far what changed its velocity is that it turned with it.
    const Vector3 turned = v - Exp(-half - 0.5 * before * b.angular_before_W) * v;
    const double share = (v - b.linear_before_W).dot(turned) / std::max(turned.squaredNorm(), 1e-300);
    const Vector3 axis = half.normalized(), across = v - axis.dot(v) * axis, ahead = Exp(half) * across;
    const double cosine = ahead.dot(across) / std::max(across.squaredNorm(), 1e-300);
    if (share <= 0 || cosine < 0.5) continue;  // more than a third of a circle in a step is no arc
    b.arc_W = 2 / dt * std::min(1.0, share) * (ahead / cosine - across);
    walls_.push_back({static_cast<int>(i), v, b.arc_W});
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
