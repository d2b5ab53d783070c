// How a body moves through a piece of a step: under constant force along a parabola, turning at a rate that changes
// evenly. Both ends and the velocities at the start are those of the piece.
//
//   x(t) = x + v t + half_a t^2,   q(t) = exp(t rate + t^2 half_change) q,   t in [0, h]
//   frames: W    units: SI    threads: plain data, pure functions
#pragma once

#include <algorithm>

#include "engine/body.h"
#include "engine/geometry/narrow_phase.h"
#include "engine/linear_algebra.h"
#include "engine/rotation.h"

namespace islet::motion {

struct Pose {
  Vector3 position_W = Vector3::Zero();  // [m]
  Quaternion rotation_WB = Quaternion::Identity();
  Placement placement() const { return {position_W, rotation_WB.toRotationMatrix()}; }
};

// A body while a step is under way.
struct State {
  Pose pose;
  Vector3 linear_W = Vector3::Zero(), angular_W = Vector3::Zero();  // [m/s], [rad/s]
  Vector3 VelocityAt(const Vector3& point_W) const { return linear_W + angular_W.cross(point_W - pose.position_W); }
};

inline State StateOf(const Body& b) {
  return {{b.position_W, b.rotation_WB}, b.linear_velocity_W, b.angular_velocity_W};
}
inline void SetState(const State& state, Body* b) {
  b->position_W = state.pose.position_W;
  b->rotation_WB = state.pose.rotation_WB;
  b->linear_velocity_W = state.linear_W;
  b->angular_velocity_W = state.angular_W;
}

struct Path {
  Pose start;
  Vector3 velocity_W = Vector3::Zero();           // [m/s] at the start
  Vector3 half_acceleration_W = Vector3::Zero();  // [m/s^2]
  Vector3 rate_W = Vector3::Zero();               // [rad/s] at the start
  Vector3 half_change_W = Vector3::Zero();        // [rad/s^2]
  double radius = 0;                              // [m] farthest point that a turn moves; 0 for what turns in itself
  double shown = 1;  // of the rate: what moves a point of the shape, as far as it is round; 1: all

  Pose At(double t) const {
    return {start.position_W + t * velocity_W + t * t * half_acceleration_W,
            (Exp(t * rate_W + t * t * half_change_W) * start.rotation_WB).normalized()};
  }
  // What is left of it at t. Turns of which the axis turns, too, are continued as they are then.
  Path From(double t) const {
    return {At(t), VelocityAt(t), half_acceleration_W, RateAt(t), half_change_W, radius, shown};
  }
  Vector3 VelocityAt(double t) const { return velocity_W + 2 * t * half_acceleration_W; }
  Vector3 RateAt(double t) const { return rate_W + 2 * t * half_change_W; }
  // [rad/s] fastest that it turns from t to `end`; 0 for what turns in itself.
  double FastestTurn(double t, double end) const {
    return radius == 0 ? 0 : shown * std::max(RateAt(t).norm(), RateAt(end).norm());
  }
  // [m/s] fastest that the turn moves a point.
  double TurnSpeed(double t, double end) const { return radius * FastestTurn(t, end); }
  // [m/s] the same along one direction. Where the axis turns, too, the angular velocity differs from RateAt by half of their cross product.
  double TurnSpeedAlong(const Vector3& n_W, double t, double end) const {
    if (radius == 0) return 0;
    const double across = std::max(RateAt(t).cross(n_W).norm(), RateAt(end).cross(n_W).norm()) +
                          0.5 * end * end * rate_W.cross(half_change_W).norm();
    return shown < 1 ? std::min(TurnSpeed(t, end), radius * across) : radius * across;
  }
};

// The path from a pose with these velocities to where the body has turned after h [s].
inline Path PathThrough(const Pose& start, const Vector3& velocity_W, const Vector3& half_acceleration_W,
                        const Vector3& rate_W, const Quaternion& end_WB, double h, double radius) {
  const Vector3 turn = Log(end_WB * start.rotation_WB.conjugate());
  return {start, velocity_W, half_acceleration_W, rate_W, (1 / (h * h)) * (turn - h * rate_W), radius};
}

}  // namespace islet::motion
