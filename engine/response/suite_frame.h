// What the stages of one ContactSuite::Resolve share. Filled from the top down. What settles without a blow changes before_gravity.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "engine/contact_suite.h"
#include "engine/response/island_problem.h"

namespace islet {

inline constexpr double kBatchCost = 64;  // contacts: smaller islands share a task

struct SuiteFrame {
  double dt = 0;                      // [s]
  Vector3 gravity = Vector3::Zero();  // [m/s^2]
  double rest_speed = 0;              // [m/s] |g| dt, or with forces their mean: what a step of free fall adds
  double speed_floor = 0;             // [m/s] least v_ref: rest_speed, or a thousandth of the fastest approach
  double threshold = 0;               // [m/s] contacts that approach slower do not collide
  std::span<Body> bodies;
  ContactFrames contacts;

  std::vector<Matrix3> frames;  // per contact
  // [N s] per contact, (n, t1, t2). `holding` begins with what held in the frame before.
  std::vector<Vector3> bounces, collisions, holding;
  std::vector<Twist> before_gravity;  // per body
};

// A body that contacts move, or would if it were awake.
inline bool CanMove(const Body& body) { return body.kind == BodyKind::kDynamic && !body.removed; }

// A body that the contact keeps in place without anyone computing its motion: fixed, frozen, or kinematic and at rest.
inline bool StandsStill(const Body& body) {
  return !body.Moves() &&
         (body.kind != BodyKind::kKinematic || (body.linear_velocity_W.isZero(0) && body.angular_velocity_W.isZero(0)));
}

inline bool AllStandStill(std::span<const Body> bodies) {
  return std::all_of(bodies.begin(), bodies.end(), StandsStill);
}

inline Twist TwistOf(const Body& body) { return {body.linear_velocity_W, body.angular_velocity_W}; }
inline void SetTwist(const Twist& twist, Body* body) {
  body->linear_velocity_W = twist.linear_W;
  body->angular_velocity_W = twist.angular_W;
}

// What gravity, external force and torque add to the velocity of a body that moves, over dt.
inline Twist ChangeByForces(double dt, const Vector3& gravity_W, const Body& body) {
  Twist change{dt * (gravity_W + body.force_W / body.mass), Vector3::Zero()};
  if (!body.torque_W.isZero(0)) change.angular_W = dt * (body.InverseInertiaW() * body.torque_W);
  return change;
}

// [m/s] bound on the speed of the body's fastest point.
inline double FastestPoint(const Twist& twist, double radius) {
  return twist.linear_W.norm() + radius * twist.angular_W.norm();
}

// [m/s] the same of all bodies that contacts move, and of walls that drive(number) them, in the middle of these: what moves is as fast seen
// from there.
template <typename Drives>
double FastestPoint(std::span<const Body> bodies, const Drives& drives) {
  double fastest = 0;
  int movers = 0;
  Vector3 sum = Vector3::Zero();
  for (const Body& b : bodies) {
    if (!b.Moves()) continue;
    fastest = std::max(fastest, FastestPoint(TwistOf(b), b.radius));
    sum += b.position_W;
    ++movers;
  }
  for (size_t i = 0; i < bodies.size(); ++i)
    if (movers > 0 && drives(i)) fastest = std::max(fastest, bodies[i].VelocityAt(sum / movers).norm());
  return fastest;
}

}  // namespace islet
