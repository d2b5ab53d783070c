// Bodies that many tests build: floors, inclines, unit cubes and spheres of 1 kg.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"

namespace islet::testing {

inline constexpr double kGravity = 9.81;  // [m/s^2]

inline Quaternion Turn(double angle, const Vector3& axis) {
  return Quaternion(Eigen::AngleAxisd(angle, axis.normalized()));
}

// One thread, and nothing freezes.
inline Settings Awake() {
  Settings settings;
  settings.threads = 1;
  settings.freezing = Freezing::kOff;
  return settings;
}

// The same moved as bodies of a crowd are, however few (Settings::group_bodies).
inline Settings AsCrowd(Settings settings) {
  settings.group_bodies = 0;
  return settings;
}

// Eight bodies that pass each other far away: where so many are a crowd, the world steps in halves.
inline void AddPassersBy(World* world) {
  for (int k = 0; k < 8; ++k)
    world->Add({.shape = Shape::Sphere(0.02),
                .mass = 0.1,
                .position_W = {50 + 0.05 * k, 0, 0},
                .linear_velocity_W = {k % 2 == 0 ? 20.0 : -20.0, 0, 5}});
}

// Half-space below z = 0, or turned by `incline` about y: it then falls towards +x.
inline BodyDefinition Floor(double friction = 0.5, double restitution = 0, double incline = 0) {
  return {.shape = Shape::HalfSpace(),
          .kind = BodyKind::kFixed,
          .rotation_WB = Turn(incline, Vector3::UnitY()),
          .friction = friction,
          .restitution = restitution};
}

inline BodyDefinition Cube(const Vector3& position, double friction = 0.5, double restitution = 0) {
  return {.shape = Shape::Box({0.5, 0.5, 0.5}),
          .mass = 1,
          .position_W = position,
          .friction = friction,
          .restitution = restitution};
}

// Four walls around the origin, a metre thick, on the floor. distance: [m] of their middles; length, height: half of theirs.
inline void AddWalls(World* world, double distance, double length, double height) {
  for (int side = 0; side < 4; ++side) {
    BodyDefinition wall = Cube(Turn(0.5 * M_PI * side, Vector3::UnitZ()) * Vector3(distance, 0, height), 0.5, 0.2);
    wall.shape = side % 2 == 0 ? Shape::Box({0.5, length, height}) : Shape::Box({length, 0.5, height});
    wall.kind = BodyKind::kFixed;
    wall.mass.reset();
    world->Add(wall);
  }
}

// A cube that lies on Floor(.., incline), its centre above the origin.
inline BodyDefinition CubeOnIncline(double incline, double friction) {
  BodyDefinition cube = Cube(Turn(incline, Vector3::UnitY()) * Vector3(0, 0, 0.5), friction);
  cube.rotation_WB = Turn(incline, Vector3::UnitY());
  return cube;
}

inline BodyDefinition Ball(const Vector3& position, double radius = 0.5, double friction = 0.5,
                           double restitution = 0) {
  return {.shape = Shape::Sphere(radius),
          .mass = 1,
          .position_W = position,
          .friction = friction,
          .restitution = restitution};
}

// Whether all bodies move by the law of the step (engine/motion), which the ledger must find clean.
inline bool MovesByLaw(const World& world) {
  const Settings& s = world.settings();
  const auto dynamic = std::count_if(world.bodies().begin(), world.bodies().end(),
                                     [](const Body& b) { return b.kind == BodyKind::kDynamic && !b.removed; });
  return dynamic <= s.group_bodies && s.model == Model::kCoulomb && s.cone == Cone::kCircular &&
         s.bounce_law == BounceLaw::kExact && s.freezing != Freezing::kPaper;
}

// Whether each impulse of the step acted within its bodies' reach: momentum is kept by one that acts anywhere. In a crowd one that holds an old
// plane may act beside the end of a rod. before: as it began.
inline bool ActsOnBodies(const World& world, std::span<const Body> before, double dt) {
  const double share = MovesByLaw(world) ? 1.05 : 1.25;
  const auto reaches = [&](int i, const Vector3& point) {
    const Body &then = before[i], &b = world.body(i);
    const double moved = dt * (then.linear_velocity_W.norm() + b.linear_velocity_W.norm() + kGravity * dt);
    return b.kind != BodyKind::kDynamic || (point - b.position_W).norm() <= share * b.radius + moved;
  };
  const std::span<const Contact> contacts = world.resolved_contacts();
  return std::all_of(contacts.begin(), contacts.end(),
                     [&](const Contact& c) { return reaches(c.body_a, c.point_W) && reaches(c.body_b, c.point_W); });
}

// What every test steps with: it looks at the ledger, and where impulses act.
inline StepReport Step(World* world, double dt) {
  const std::vector<Body> before(world->bodies().begin(), world->bodies().end());
  StepReport report = world->Step(dt);
  EXPECT_TRUE(world->settings().model != Model::kCoulomb || ActsOnBodies(*world, before, dt))
      << "at " << world->time() << " s an impulse acts beside a body";
  if (MovesByLaw(*world)) {
    EXPECT_FALSE(report.Failed()) << "at " << world->time() << " s: energy " << report.ledger.energy_created.value
                                  << ", momentum " << report.ledger.momentum_unexplained.value << ", angular "
                                  << report.ledger.angular_momentum_unexplained.value << ", sides "
                                  << report.ledger.sides_changed << ", unstepped " << report.unstepped;
  }
  return report;
}

inline void StepTimes(World* world, int frames, double dt = 1.0 / 60) {
  for (int i = 0; i < frames; ++i) Step(world, dt);
}

// [J] of the dynamic bodies, potential energy counted from z = 0.
inline double Energy(std::span<const Body> bodies, double gravity = kGravity) {
  double energy = 0;
  for (const Body& b : bodies)
    if (b.kind == BodyKind::kDynamic && !b.removed) energy += b.KineticEnergy() + b.mass * gravity * b.position_W.z();
  return energy;
}

inline Vector3 Momentum(std::span<const Body> bodies) {
  Vector3 sum = Vector3::Zero();
  for (const Body& b : bodies)
    if (b.kind == BodyKind::kDynamic && !b.removed) sum += b.mass * b.linear_velocity_W;
  return sum;
}

// [N m s] about the origin.
inline Vector3 AngularMomentum(std::span<const Body> bodies) {
  Vector3 sum = Vector3::Zero();
  for (const Body& b : bodies)
    if (b.kind == BodyKind::kDynamic && !b.removed)
      sum += b.position_W.cross(b.mass * b.linear_velocity_W) + b.AngularMomentumW();
  return sum;
}

// [N s] that the last step's contacts put on `body`.
inline Vector3 ImpulseOn(const World& world, int body) {
  Vector3 sum = Vector3::Zero();
  for (size_t c = 0; c < world.resolved_contacts().size(); ++c) {
    if (world.resolved_contacts()[c].body_a == body) sum -= world.impulses()[c];
    if (world.resolved_contacts()[c].body_b == body) sum += world.impulses()[c];
  }
  return sum;
}

}  // namespace islet::testing
