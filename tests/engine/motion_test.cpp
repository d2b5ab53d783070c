// The position update as it acts in whole steps.
#include "engine/motion.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "parallel/worker_pool.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::Ball;
using testing::Cube;
using testing::CubeOnIncline;
using testing::Energy;
using testing::Floor;
using testing::kGravity;
using testing::Turn;

Settings Weightless() {
  Settings settings = Awake();
  settings.gravity.setZero();
  return settings;
}

// Two cubes that would end one inside the other: they meet halfway, by symmetry.
TEST(Mover, CubesThatWouldOverlapMeetInTheMiddle) {
  World world(Weightless());
  BodyDefinition left = Cube({-0.6, 0, 0}), right = Cube({0.6, 0, 0});
  left.linear_velocity_W = {20, 0, 0};
  right.linear_velocity_W = {-20, 0, 0};
  world.Add(left), world.Add(right);
  const StepReport report = testing::Step(&world, 1.0 / 60);  // free motion would swap them
  EXPECT_LE(report.penetration_max, 2.5e-4);
  EXPECT_EQ(report.motion_failures, 0);
  EXPECT_NEAR(world.body(1).position_W.x() - world.body(0).position_W.x(), 1, 3e-4);
  EXPECT_NEAR(world.body(1).position_W.x() + world.body(0).position_W.x(), 0, 1e-9);
  testing::Step(&world, 1.0 / 60);
  EXPECT_NEAR(world.body(0).linear_velocity_W.x(), 0, 1e-6);  // e = 0
}

// Corner against face, both turning.
TEST(Mover, TurningCubesEndApart) {
  for (const double spin : {-15.0, 5.0, 30.0}) {
    World world(Weightless());
    BodyDefinition left = Cube({-0.9, 0.1, 0.05}), right = Cube({0.9, 0, 0});
    left.rotation_WB = Turn(0.7, {1, 2, 3});
    left.linear_velocity_W = {15, 0, 0};
    left.angular_velocity_W = {spin, 1, spin};
    right.linear_velocity_W = {-15, 0, 0};
    right.angular_velocity_W = {0, spin, 0};
    world.Add(left), world.Add(right);
    for (int frame = 0; frame < 30; ++frame) {
      const StepReport report = testing::Step(&world, 1.0 / 60);
      EXPECT_LE(report.penetration_max, 2.5e-4) << spin << " " << frame;
    }
  }
}

TEST(Mover, FastSphereDoesNotTunnelThroughAThinPlate) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    for (const double speed : {20.0, 50.0, 200.0}) {
      World world(Weightless());
      world.Add({.shape = Shape::Box({2, 2, 0.05}), .kind = BodyKind::kFixed, .restitution = 0});
      BodyDefinition ball = Ball({0.3, 0.2, 2.0123}, 0.1);
      ball.linear_velocity_W = {0, 0, -speed};
      world.Add(ball);
      for (int i = 0; i < 3 + 2 / (speed * dt); ++i) {
        testing::Step(&world, dt);
        ASSERT_GT(world.body(1).position_W.z(), 0.149) << dt << " " << speed << " " << i;
      }
      EXPECT_NEAR(world.body(1).linear_velocity_W.norm(), 0, 1e-6);
    }
  }
}

TEST(Mover, FastSphereDoesNotTunnelThroughAThinMovingPlate) {
  World world(Weightless());
  world.Add({.shape = Shape::Box({2, 2, 0.05}), .mass = 100, .restitution = 0});
  BodyDefinition ball = Ball({0, 0, 2.0123}, 0.1);
  ball.linear_velocity_W = {0, 0, -50};
  world.Add(ball);
  for (int i = 0; i < 20; ++i) testing::Step(&world, 1.0 / 60);
  EXPECT_GT(world.body(1).position_W.z() - world.body(0).position_W.z(), 0.149);
  EXPECT_NEAR(world.body(1).linear_velocity_W.z(), -50.0 / 101, 1e-5);
}

// T10: e = 1 from 1 m. The peak stays within a micrometre over twenty bounces.
TEST(Mover, ElasticBallKeepsItsHeight) {
  for (const double dt : {1.0 / 60, 1.0 / 240}) {
    World world(Awake());
    world.Add(Floor(0, 1));
    world.Add(Ball({0, 0, 1.5}, 0.5, 0, 1));
    const double energy = Energy(world.bodies());
    int bounces = 0;
    double lowest_energy = energy, highest_energy = energy;
    for (double last = 0; bounces < 20 && world.time() < 30;) {
      testing::Step(&world, dt);
      const double speed = world.body(1).linear_velocity_W.z();
      bounces += last < 0 && speed > 0;
      last = speed;
      lowest_energy = std::min(lowest_energy, Energy(world.bodies()));
      highest_energy = std::max(highest_energy, Energy(world.bodies()));
    }
    EXPECT_EQ(bounces, 20);
    EXPECT_LE((highest_energy - energy) / kGravity, 1e-6) << dt;
    EXPECT_GE((lowest_energy - energy) / kGravity, -1e-6) << dt;
  }
}

// With e < 1 every peak is e^2 of the one before.
TEST(Mover, BallLosesHeightAsItsRestitutionSays) {
  for (const double restitution : {0.5, 0.9}) {
    World world(Awake());
    world.Add(Floor(0, restitution));
    world.Add(Ball({0, 0, 1.5}, 0.5, 0, restitution));
    double expected = 1, last = 0;
    int bounces = 0;
    for (; bounces < 4 && world.time() < 10;) {
      testing::Step(&world, 1.0 / 240);
      const double speed = world.body(1).linear_velocity_W.z();
      const double peak = world.body(1).position_W.z() - 0.5 + 0.5 * speed * speed / kGravity;
      if (last < 0 && speed > 0) ++bounces, expected *= restitution * restitution;
      if (speed > 0) {
        EXPECT_NEAR(peak, expected, 1e-3 + 3e-3 * expected) << restitution << " " << bounces;
      }
      last = speed;
    }
    EXPECT_EQ(bounces, 4);
  }
}

// T1: ten seconds at 0.99 of the friction angle, never frozen.
TEST(Mover, RestingCubeDoesNotCreepDownAnIncline) {
  for (const double dt : {1.0 / 30, 1.0 / 60}) {
    for (const double friction : {0.3, 0.8}) {
      const double incline = std::atan(0.99 * friction);
      World world(Awake());
      world.Add(Floor(friction, 0, incline));
      world.Add(CubeOnIncline(incline, friction));
      const Vector3 start = world.body(1).position_W;
      for (double t = 0; t < 10; t += dt) testing::Step(&world, dt);
      const double creep = (world.body(1).position_W - start).norm() / 10;
      EXPECT_LT(creep, 1e-7) << "m/s, dt " << dt << " friction " << friction;
    }
  }
}

// T2: a = g (sin - mu cos), without lift or spin.
TEST(Mover, CubeSlidesDownASteeperInclineAtTheRightRate) {
  for (const double dt : {1.0 / 30, 1.0 / 240}) {
    for (const double share : {1.01, 1.2, 2.0}) {
      const double friction = 0.4, incline = std::atan(share * friction);
      World world(Awake());
      world.Add(Floor(friction, 0, incline));
      world.Add(CubeOnIncline(incline, friction));
      const Vector3 start = world.body(1).position_W;
      while (world.time() < 1 - 1e-9) testing::Step(&world, dt);
      const double acceleration = kGravity * (std::sin(incline) - friction * std::cos(incline));
      const Vector3 travel = Turn(-incline, Vector3::UnitY()) * (world.body(1).position_W - start);
      EXPECT_NEAR(travel.x(), 0.5 * acceleration, 1e-3 * acceleration) << dt << " " << share;
      EXPECT_NEAR(travel.z(), 0, 1e-4);
      EXPECT_NEAR(world.body(1).angular_velocity_W.norm(), 0, 1e-4);
    }
  }
}

// T4: v0 = 6, mu = 0.5: stops after v0^2 / (2 mu g) and never leaves the floor.
TEST(Mover, SlidingCubeStopsWhereItShould) {
  World world(Awake());
  world.Add(Floor(0.5));
  BodyDefinition cube{.shape = Shape::Box({0.05, 0.05, 0.05}),
                      .mass = 1,
                      .position_W = {0, 0, 0.05},
                      .linear_velocity_W = {3.6, 4.8, 0},
                      .friction = 0.5,
                      .restitution = 0};
  world.Add(cube);
  double apex = 0;
  while (world.time() < 2) {
    testing::Step(&world, 1.0 / 60);
    apex = std::max(apex, world.body(1).position_W.z() - 0.05);
  }
  const Vector3 end = world.body(1).position_W;
  EXPECT_NEAR(std::hypot(end.x(), end.y()), 36 / kGravity, 0.01);
  EXPECT_NEAR(std::atan2(end.y(), end.x()), std::atan2(4.8, 3.6), 1e-3);
  EXPECT_LT(apex, 2e-4);
  EXPECT_NEAR(world.body(1).linear_velocity_W.norm(), 0, 1e-6);
}

// T7: a ball that starts sliding rolls at 5/7 of its speed.
TEST(Mover, SlidingBallEndsRollingAtFiveSevenths) {
  World world(Awake());
  world.Add(Floor(0.4));
  BodyDefinition ball = Ball({0, 0, 0.5}, 0.5, 0.4);
  ball.linear_velocity_W = {3, 0, 0};
  world.Add(ball);
  while (world.time() < 1) testing::Step(&world, 1.0 / 240);
  EXPECT_NEAR(world.body(1).linear_velocity_W.x(), 15.0 / 7, 1e-5);
  EXPECT_NEAR(world.body(1).angular_velocity_W.y(), 30.0 / 7, 1e-4);
}

// T8: rolls down at 5/7 g sin.
TEST(Mover, BallRollsDownAnIncline) {
  const double incline = 0.3;
  World world(Awake());
  world.Add(Floor(0.5, 0, incline));
  world.Add(Ball(Turn(incline, Vector3::UnitY()) * Vector3(0, 0, 0.5)));
  while (world.time() < 1 - 1e-9) testing::Step(&world, 1.0 / 60);
  EXPECT_NEAR(world.body(1).linear_velocity_W.norm(), 5.0 / 7 * kGravity * std::sin(incline), 1e-4);
}

// T29: a cube spins on its four corners: torque mu m g r, r = 1 / sqrt 2, I = 1 / 6.
TEST(Mover, SpinningCubeSlowsDownAtTheRightRateOnItsSpot) {
  World world(Awake());
  world.Add(Floor(0.5));
  BodyDefinition cube = Cube({0, 0, 0.5});
  cube.angular_velocity_W = {0, 0, 20};
  world.Add(cube);
  for (int i = 0; i < 30; ++i) testing::Step(&world, 1.0 / 60);
  EXPECT_NEAR(world.body(1).angular_velocity_W.z(), 20 - 0.5 * 0.5 * kGravity * 6 / std::sqrt(2.0), 1e-4);
  EXPECT_LT((world.body(1).position_W - Vector3(0, 0, 0.5)).norm(), 1e-6);
}

// T22: the tip of a slender rod slides where rigid-body mechanics has no continuous answer (mu = 2, 1.33 would do).
TEST(Mover, PainleveRodNeverGainsEnergy) {
  World world(Awake());
  world.Add(Floor(2));
  BodyDefinition rod{.shape = Shape::Box({0.02, 0.02, 1}), .mass = 1, .friction = 2};
  const double lean = std::atan(2.0);  // from the plane
  rod.rotation_WB = Turn(std::atan(0.5), Vector3::UnitY());
  rod.position_W = {0, 0, std::sin(lean) + 0.02 * std::cos(lean) + 1e-4};
  rod.linear_velocity_W = {-5, 0, 0};
  world.Add(rod);
  double energy = Energy(world.bodies());
  const double start = energy;
  for (int i = 0; i < 120; ++i) {
    testing::Step(&world, 1.0 / 240);
    const double now = Energy(world.bodies());
    ASSERT_LE(now, energy + 1e-6) << i;
    energy = now;
  }
  EXPECT_LT(energy, 0.9 * start);
}

// Bodies flying into each other, no gravity.
std::vector<BodyDefinition> Cloud(unsigned seed, double friction, double restitution, bool boxes) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<BodyDefinition> cloud;
  for (int i = 0; i < 27; ++i) {
    const Vector3 place(2.0 * (i % 3 - 1), 2.0 * (i / 3 % 3 - 1), 2.0 * (i / 9 - 1));
    BodyDefinition body = boxes ? Cube(place, friction, restitution) : Ball(place, 0.5, friction, restitution);
    if (boxes)
      body.shape = Shape::Box({0.4, 0.5, 0.6}), body.rotation_WB = Turn(uniform(rng), {uniform(rng), uniform(rng), 1});
    body.mass = 1.5 + uniform(rng);
    body.linear_velocity_W = -2 * place + Vector3(uniform(rng), uniform(rng), uniform(rng));
    body.angular_velocity_W = 3 * Vector3(uniform(rng), uniform(rng), uniform(rng));
    cloud.push_back(body);
  }
  return cloud;
}

// T31: momentum to rounding, energy never up. For the angular momentum see impact_test.cpp.
TEST(Mover, FreeCloudKeepsMomentumAndNeverGainsEnergy) {
  for (const bool boxes : {false, true}) {
    for (const double restitution : {0.0, 0.5, 1.0}) {
      World world(Weightless());
      for (const BodyDefinition& body : Cloud(5, 0.5, restitution, boxes)) world.Add(body);
      const Vector3 momentum = testing::Momentum(world.bodies());
      const double start = Energy(world.bodies(), 0);
      double energy = start;
      int contacts = 0;
      for (int frame = 0; frame < 120; ++frame) {
        contacts += testing::Step(&world, 1.0 / 60).contacts;
        const double now = Energy(world.bodies(), 0);
        EXPECT_LE(now, energy + (boxes ? 5e-4 : 1e-9) * start) << boxes << " " << restitution << " " << frame;
        energy = now;
      }
      EXPECT_LT(energy, 0.9 * start);
      EXPECT_GT(contacts, 30);
      EXPECT_LT((testing::Momentum(world.bodies()) - momentum).norm(), 1e-10) << boxes << " " << restitution;
    }
  }
}

// A row of 300 that all close in: overlaps of a few centimetres between neighbours, and metres back for those at the ends. They
// used to be held back where the step began, in every step, for ever, and no report told.
TEST(Mover, LongRowThatClosesInFastMeets) {
  constexpr int kCount = 300;
  constexpr double kSpeed = 200, kMiddle = 0.5 * (kCount - 1);
  World world(Weightless());
  for (int i = 0; i < kCount; ++i) {
    BodyDefinition ball = Ball({1.01 * (i - kMiddle), 0, 0}, 0.5, 0, 0);
    ball.linear_velocity_W.x() = -kSpeed * (i - kMiddle) / kMiddle;
    world.Add(ball);
  }
  for (int frame = 0; frame < 4; ++frame) {
    const StepReport report = testing::Step(&world, 1.0 / 60);
    EXPECT_EQ(report.motion_failures, 0) << frame;
    EXPECT_LE(report.penetration_max, 2.5e-4) << frame;
  }
  EXPECT_NEAR(world.body(kCount - 1).position_W.x(), kMiddle, 0.05);
  EXPECT_NEAR(Energy(world.bodies(), 0), 0, 1e-6);
}

// Corrections weigh bodies by mass. Between boxes of ten tons the light ones gave way, and by metres: 7 in one step.
TEST(Mover, LightBoxesAmongHeavyOnesAreNotThrown) {
  World world{Settings{}};
  world.Add(Floor(0.5, 0.2));
  for (int i = 0; i < 45; ++i) {
    const int layer = i / 9, row = i / 3 % 3, column = i % 3;
    BodyDefinition box = Cube({1.01 * row + 0.01 * layer, 1.01 * column + 0.01 * layer, 0.5 + 1.02 * layer}, 0.5, 0.2);
    box.mass = i % 2 == 0 ? 1 : 1e4;
    world.Add(box);
  }
  const double energy = Energy(world.bodies(), kGravity);
  for (int frame = 0; frame < 60; ++frame) {
    const std::vector<Body> before(world.bodies().begin(), world.bodies().end());
    const StepReport report = testing::Step(&world, 1.0 / 60);
    EXPECT_EQ(report.motion_failures, 0) << frame;
    for (size_t i = 1; i < before.size(); ++i) {
      const double way = (world.body(static_cast<int>(i)).position_W - before[i].position_W).norm();
      EXPECT_LT(way, 0.2) << frame << " " << i;
    }
    EXPECT_LT(Energy(world.bodies(), kGravity), 1.001 * energy);
  }
}

// Between two planes that close in at 1e-2 rad the linear problem sees the way out at 20 cm for 2 mm of overlap. It is gone in
// steps that detection can follow. (The heap of an hourglass once threw a cube at rest through the wall.)
TEST(Mover, WhatIsSqueezedIsNotThrownOut) {
  const double overlap = 1e-3;
  std::vector<Body> bodies(3);
  bodies[0].kind = bodies[2].kind = BodyKind::kFixed;
  bodies[1].inertia_B = Matrix3::Identity() / 6;
  bodies[1].radius = std::sqrt(0.75);
  std::vector<Contact> contacts(2);
  contacts[0] = {.body_a = 0, .body_b = 1, .point_W = {0, 0, -0.5}};
  contacts[1] = {.body_a = 1, .body_b = 2, .point_W = {0, 0, 0.5}, .normal_W = {std::sin(1e-2), 0, std::cos(1e-2)}};
  Vector3 last = bodies[1].position_W;
  double farthest = 0;
  const auto detect = [&](std::span<const Vector3>, std::vector<Contact>* found) {
    farthest = std::max(farthest, (bodies[1].position_W - last).norm());
    last = bodies[1].position_W;
    found->at(0).gap = bodies[1].position_W.z() - overlap;
    found->at(1).gap = -contacts[1].normal_W.dot(bodies[1].position_W) - overlap;
  };
  detect({}, &contacts);
  parallel::WorkerPool pool(1);
  Mover mover(Awake(), &pool);
  const std::vector<Twist> before(3);
  const std::vector<double> durations(3, 1.0 / 60), tolerances(3, 2.5e-4);
  const std::vector<std::uint8_t> flies(3, 0);
  const MotionPlan plan{.dt = 1.0 / 60, .durations = durations, .flies = flies, .owes = flies, .before = before};
  mover.PlanTravel(plan, bodies);
  const MotionOutcome outcome = mover.Move(plan, tolerances, detect, bodies, &contacts);
  EXPECT_TRUE(outcome.reached);
  EXPECT_GT(outcome.passes, 5);
  EXPECT_LT(farthest, 30 * overlap);  // 20 times the deepest of a pass
}

// Flying apart, tumbling: both momenta and the energy to rounding.
TEST(Mover, TumblingBodiesInFreeFlightKeepEverything) {
  World world(Weightless());
  for (BodyDefinition& body : Cloud(5, 0.5, 1, true)) {
    body.linear_velocity_W = 0.5 * body.position_W;
    world.Add(body);
  }
  const Vector3 momentum = testing::Momentum(world.bodies()), angular = testing::AngularMomentum(world.bodies());
  const double energy = Energy(world.bodies(), 0);
  for (int frame = 0; frame < 300; ++frame) ASSERT_EQ(testing::Step(&world, 1.0 / 30).contacts, 0);
  EXPECT_LT((testing::Momentum(world.bodies()) - momentum).norm(), 1e-12 * 100);
  EXPECT_LT((testing::AngularMomentum(world.bodies()) - angular).norm(), 1e-12 * 100);
  EXPECT_NEAR(Energy(world.bodies(), 0), energy, 1e-12 * energy);
}

// Elastic and smooth: energy stays.
TEST(Mover, ElasticFrictionlessCloudKeepsItsEnergy) {
  World world(Weightless());
  for (const BodyDefinition& body : Cloud(6, 0, 1, false)) world.Add(body);
  const double energy = Energy(world.bodies(), 0);
  for (int frame = 0; frame < 120; ++frame) testing::Step(&world, 1.0 / 60);
  EXPECT_NEAR(Energy(world.bodies(), 0), energy, 1e-6 * energy);
}

// Falling into a heap: nothing overlaps. Who is lifted out of an overlap when it hits gets that height for nothing, but loses
// more in the next frames: over ten the energy falls.
TEST(Mover, FallingHeapLosesEnergyAndNeverOverlaps) {
  for (const double restitution : {0.0, 0.5, 1.0}) {
    World world(Awake());
    world.Add(Floor(0.5, restitution));
    std::mt19937 rng(8);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int i = 0; i < 24; ++i) {
      BodyDefinition cube =
          Cube({0.3 * uniform(rng) + 2.4 * (i % 2), 0.3 * uniform(rng), 1 + 1.8 * (i / 2)}, 0.5, restitution);
      cube.rotation_WB = Turn(uniform(rng), {uniform(rng), uniform(rng), 1});
      world.Add(cube);
    }
    std::vector<double> energies{Energy(world.bodies())};
    for (int frame = 0; frame < 240; ++frame) {
      const StepReport report = testing::Step(&world, 1.0 / 60);
      // Twice the tolerance: corrections end at motion_passes. In 18 such heaps 3.7e-4 at most, above 2.5e-4 in 1 of 50 frames.
      EXPECT_LE(report.penetration_max, 5e-4) << restitution << " " << frame;
      energies.push_back(Energy(world.bodies()));
    }
    const double start = energies[0];
    for (size_t k = 1; k < energies.size(); ++k) {
      EXPECT_LT(energies[k] - energies[k - 1], 1e-3 * start) << "frame " << k << ", restitution " << restitution;
      if (k < 10 || k + 2 >= energies.size()) continue;
      const double kept = std::min({energies[k], energies[k + 1], energies[k + 2]});
      EXPECT_LT(kept - energies[k - 10], 1e-5 * start) << "frame " << k << ", restitution " << restitution;
    }
  }
}

}  // namespace
}  // namespace islet
