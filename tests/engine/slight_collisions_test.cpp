// Collisions that the static problem takes along (rung `merged`): which do, that the answer is that of both problems where
// nothing lets go in between, and that what is no such collision is still resolved as one.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "engine/contact.h"
#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Ball;
using testing::Cube;
using testing::Energy;
using testing::Floor;
using testing::ImpulseOn;
using testing::kGravity;

constexpr double kDt = 1.0 / 60;
constexpr double kFall = kGravity * kDt;

Settings Awake(bool merged) {
  Settings settings = testing::AsCrowd({});  // small groups have blows, however slight
  settings.freezing = Freezing::kOff;
  settings.threads = 1;
  if (!merged) settings.ladder = settings.ladder.Without(qp::Rung::kMerged);
  return settings;
}

std::int64_t Merged(const StepReport& report) {
  return report.ladder.rungs[static_cast<int>(qp::Rung::kMerged)].problems;
}

// Cubes side by side, that slide across the row: one island, in which the cubes do nothing to each other.
World SlidingRow(const Settings& settings, double speed, double approach, double restitution = 0, int length = 5) {
  World world(settings);
  world.Add(Floor(0.5, restitution));
  for (int i = 0; i < length; ++i) {
    BodyDefinition cube = Cube({0, static_cast<double>(i), 0.5}, 0.5, restitution);
    cube.linear_velocity_W = {speed, 0, -approach};
    world.Add(cube);
  }
  return world;
}

TEST(SlightCollisions, UpToFreeFallWithoutReboundsNeverElastic) {
  const Vector3 gravity(0, 0, -kGravity);
  Contact contact;
  EXPECT_DOUBLE_EQ(SlightApproach(contact, gravity, kDt), kFall);
  contact.restitution = 0.2;  // 0.2 u <= 0.05 * 0.8 g dt
  EXPECT_DOUBLE_EQ(SlightApproach(contact, gravity, kDt), 0.2 * kFall);
  contact.normal_W = Vector3::UnitX();  // gravity does not press it: 0.2 u <= 0.01 * 0.8 g dt
  EXPECT_DOUBLE_EQ(SlightApproach(contact, gravity, kDt), 0.04 * kFall);
  contact.fading = 0.1 * kFall;  // but others do: that takes the rebound
  EXPECT_DOUBLE_EQ(SlightApproach(contact, gravity, kDt), 0.54 * kFall);
  contact.fading = 0;
  contact.restitution = 1;
  EXPECT_EQ(SlightApproach(contact, gravity, kDt), 0);
  contact.restitution = 0;
  EXPECT_EQ(SlightApproach(contact, Vector3::Zero(), kDt), 0) << "without gravity nothing is slight";
}

// Cubes in the air, the middle one spinning: they fall like one, and keep their momenta.
TEST(SlightCollisions, NotInFreeFall) {
  World world(Awake(true));
  for (int i = 0; i < 9; ++i) {
    BodyDefinition cube = Cube({static_cast<double>(i % 3), static_cast<double>(i / 3), 100});
    if (i == 4) cube.angular_velocity_W = {0.3, 0.2, 1};
    world.Add(cube);
  }
  const Vector3 spin = testing::AngularMomentum(world.bodies());
  for (int frame = 0; frame < 60; ++frame) EXPECT_EQ(Merged(testing::Step(&world, kDt)), 0);
  Vector3 centre = Vector3::Zero();
  for (const Body& body : world.bodies()) centre += body.position_W / 9;
  EXPECT_LT((centre - Vector3(1, 1, 100 - 0.5 * kGravity)).norm(), 1e-9);
  const Vector3 arm = Vector3(1, 1, 100).cross(9 * Vector3(0, 0, -kGravity));  // torque of the weight about the origin
  EXPECT_LT((testing::AngularMomentum(world.bodies()) - spin - arm).norm(), 1e-9);
}

// A row that slides into a wall without friction: nothing presses it there, so it comes back.
TEST(SlightCollisions, NotAgainstAWallThatNothingPressesAt) {
  World world(Awake(true));
  world.Add(Floor(0, 0.5));
  world.Add({.shape = Shape::Box({0.5, 4, 0.5}),
             .kind = BodyKind::kFixed,
             .position_W = {-1, 3, 0.5},
             .friction = 0,
             .restitution = 0.5});
  const double u = 0.045 * kFall;
  for (int i = 0; i < 6; ++i) {
    BodyDefinition cube = Cube({0, static_cast<double>(i), 0.5}, 0, 0.5);
    cube.linear_velocity_W = {-u, 0, 0};
    world.Add(cube);
  }
  testing::Step(&world, kDt);
  for (int i = 2; i < 8; ++i) EXPECT_NEAR(world.body(i).linear_velocity_W.x(), 0.5 * u, 1e-6 * kFall) << i;
}

// By hand: the floor stops m (u + g dt) and rubs half of that, in one problem as in two.
TEST(SlightCollisions, SlidingRowByHand) {
  const double u = 0.3 * kFall, stopped = u + kFall;
  for (const bool merged : {true, false}) {
    World world = SlidingRow(Awake(merged), 2, u);
    const StepReport report = testing::Step(&world, kDt);
    EXPECT_EQ(Merged(report), merged);
    EXPECT_EQ(report.bounces == 0, merged);
    for (int i = 1; i <= 5; ++i) {
      const Body& cube = world.body(i);
      EXPECT_NEAR(cube.linear_velocity_W.x(), 2 - 0.5 * stopped, 2e-6);
      EXPECT_NEAR(cube.linear_velocity_W.z(), 0, 2e-6);
      EXPECT_LT(cube.angular_velocity_W.norm(), 1e-5);
      EXPECT_LT((ImpulseOn(world, i) - Vector3(-0.5, 0, 1) * stopped).norm(), 2e-6);
    }
  }
}

TEST(SlightCollisions, NotAmongFewBodies) {
  EXPECT_EQ(Merged(SlidingRow(Awake(true), 2, 0.3 * kFall, 0, 4).Step(kDt)), 0);
}

// Frozen bodies and a wall that comes: no static problem would take their collision along.
TEST(SlightCollisions, NotBetweenBodiesThatNoProblemMoves) {
  Settings settings = Awake(true);
  settings.freezing = Freezing::kCertified;
  World world(settings);
  world.Add(Floor());
  for (int i = 0; i < 6; ++i) world.Add(Cube({static_cast<double>(i), 0, 0.5}));
  BodyDefinition wall = Cube({-1.002, 0, 0.6}, 0);
  wall.kind = BodyKind::kKinematic;
  const int pusher = world.Add(wall);
  testing::StepTimes(&world, 60);
  ASSERT_TRUE(world.body(1).frozen);
  world.SetVelocity(pusher, {1e-3, 0, 0}, Vector3::Zero());
  int pushed = 0;
  for (int frame = 0; frame < 180; ++frame) {
    const bool touches = std::any_of(world.contacts().begin(), world.contacts().end(),
                                     [&](const Contact& c) { return c.body_a == 1 && c.body_b == pusher; });
    testing::Step(&world, kDt);
    if (!touches) continue;
    ++pushed;
    for (int i = 1; i <= 6; ++i) ASSERT_NEAR(world.body(i).linear_velocity_W.x(), 1e-3, 1e-6) << frame;
  }
  EXPECT_GT(pushed, 30);
}

// The approach is over before the body moves: it neither sinks in nor is pushed out, and the lift costs no sliding distance.
TEST(SlightCollisions, MovesWithTheVelocityAfterwards) {
  World world = SlidingRow(Awake(true), 2, 0.3 * kFall);
  ASSERT_EQ(Merged(testing::Step(&world, kDt)), 1);
  EXPECT_NEAR(world.body(1).position_W.z(), 0.5, 1e-7);
  EXPECT_NEAR(world.body(1).position_W.x(), kDt * world.body(1).linear_velocity_W.x(), 1e-7);
}

TEST(SlightCollisions, OnTheOtherSideOfTheLimitItIsACollision) {
  for (const auto& [restitution, approach, merged] : {std::tuple{0.0, 0.99, 1},
                                                      {0.0, 1.01, 0},
                                                      {0.2, 0.19, 1},
                                                      {0.2, 0.21, 0},
                                                      {0.9, 5e-3, 1},
                                                      {0.9, 6e-3, 0},
                                                      {1.0, 1e-3, 0}}) {
    SCOPED_TRACE(::testing::Message() << "e = " << restitution << ", " << approach << " g dt");
    World world = SlidingRow(Awake(true), 0, approach * kFall, restitution);
    const StepReport report = testing::Step(&world, kDt);
    EXPECT_EQ(Merged(report), merged);
    EXPECT_EQ(report.bounces + report.collision_qp.solved > 0, !merged);
  }
}

TEST(SlightCollisions, OnlyByTheExactLawAndOnlyWithWeight) {
  Settings paper = Settings::Paper();
  paper.freezing = Freezing::kOff;
  EXPECT_EQ(Merged(SlidingRow(paper, 0, 0.3 * kFall).Step(kDt)), 0);
  Settings weightless = Awake(true);
  weightless.gravity.setZero();
  EXPECT_EQ(Merged(SlidingRow(weightless, 0, 1e-3).Step(kDt)), 0);
}

// One blow in the island, and all its collisions are resolved first.
TEST(SlightCollisions, NotBesideABlow) {
  World world = SlidingRow(Awake(true), 0, 0.3 * kFall);
  BodyDefinition second = Cube({0, 2, 1.5});
  second.linear_velocity_W = {0, 0, -3};
  world.Add(second);
  const StepReport report = testing::Step(&world, kDt);
  EXPECT_EQ(Merged(report), 0);
  EXPECT_GT(report.bounces, 0);
}

// A layer of cubes side by side, and one that falls on it: flat on one of them, or askew on four.
constexpr int kSide = 8;
struct Layer {
  World world;
  StepReport report;
  std::vector<Body> before;

  Layer(const Settings& settings, double restitution, bool flat) : world(settings) {
    world.Add(Floor(0.5, restitution));
    for (int i = 0; i < kSide * kSide; ++i)
      world.Add(Cube({static_cast<double>(i % kSide), static_cast<double>(i / kSide), 0.5}, 0.5, restitution));
    BodyDefinition falls = Cube(flat ? Vector3(3, 3, 1.5) : Vector3(3.4, 3.3, 1.5), 0.5, restitution);
    falls.linear_velocity_W = flat ? Vector3(0, 0, -3) : Vector3(0.5, 0.2, -3);
    if (flat) falls.shape = Shape::Box({0.3, 0.3, 0.5});
    if (!flat) falls.angular_velocity_W = {0.4, 0, 0.3};
    world.Add(falls);
    before.assign(world.bodies().begin(), world.bodies().end());
    report = testing::Step(&world, kDt);
  }
  const Body& cube(int i) const { return world.body(i + 1); }
};

// Its blow bounces until the rest is slight, and the static problem takes that along; by the paper's limit of bounces the collision
// problem has the rest. Momentum is kept in both, and the cubes end up much alike.
TEST(SlightCollisions, AFewBlowsOnAHeapNeedNoCollisionProblem) {
  Settings few = Awake(true);
  few.bounce_limit = 30;
  const Layer by_problem(few, 0.2, false), by_bounces(Awake(true), 0.2, false);
  EXPECT_GT(by_problem.report.collision_qp.solved, 0);
  EXPECT_EQ(by_bounces.report.collision_qp.solved, 0);
  EXPECT_EQ(Merged(by_bounces.report), 1);
  EXPECT_GT(by_bounces.report.bounces, 0);
  for (const Layer* layer : {&by_problem, &by_bounces}) {
    EXPECT_LE(layer->report.certificate.dual, 1e-6);
    for (int i = 0; i <= kSide * kSide; ++i) {
      const Vector3 weight = Vector3(0, 0, -kGravity * kDt),
                    gained = layer->cube(i).linear_velocity_W - layer->before[i + 1].linear_velocity_W;
      EXPECT_LT((ImpulseOn(layer->world, i + 1) + weight - gained).norm(), 1e-12) << i;
    }
  }
  for (int i = 0; i < kSide * kSide; ++i)
    EXPECT_LT((by_problem.cube(i).linear_velocity_W - by_bounces.cube(i).linear_velocity_W).norm(), 0.1 * kFall) << i;
  const Vector3 after = by_problem.cube(kSide * kSide).linear_velocity_W;
  EXPECT_GT((after - Vector3(0.5, 0.2, -3)).norm(), 2);  // the blow was not left out of both
  EXPECT_LT((after - by_bounces.cube(kSide * kSide).linear_velocity_W).norm(), 0.3);
}

// All of them fall: that many blows are the collision problem's, after the paper's number of bounces.
TEST(SlightCollisions, ManyBlowsOnAHeapAreACollisionProblem) {
  World world(Awake(true));
  world.Add(Floor(0.5, 0.2));
  for (int i = 0; i < kSide * kSide; ++i) {
    BodyDefinition cube = Cube({static_cast<double>(i % kSide), static_cast<double>(i / kSide), 0.5}, 0.5, 0.2);
    cube.linear_velocity_W = {0, 0, -3 - 0.01 * i};
    world.Add(cube);
  }
  const StepReport report = testing::Step(&world, kDt);
  EXPECT_GT(report.bounces, 0);
  EXPECT_EQ(report.collision_qp.solved, 1);
  EXPECT_EQ(Merged(report), 0);
}

// Ties in heaps are solved less exactly than elsewhere, but not so that one could see it.
TEST(SlightCollisions, WhatLandsFlatOnAHeapDoesNotSpin) {
  const Layer layer(Awake(true), 0.5, true);
  EXPECT_GT(layer.report.bounces, 0);
  EXPECT_EQ(layer.report.collision_qp.solved, 0);
  EXPECT_GT(layer.cube(kSide * kSide).linear_velocity_W.z(), 0);
  EXPECT_LT(layer.cube(kSide * kSide).angular_velocity_W.norm(), 1e-5);
}

// Five balls into a long row on a floor push out five: elastic blows have more bounces than heaps.
TEST(SlightCollisions, ElasticRowsPassOnBlowsHoweverLong) {
  Settings settings = Awake(true);
  World world(settings);
  world.Add(Floor(0, 1));
  constexpr int kBalls = 80, kIncoming = 5;
  for (int i = 0; i < kBalls; ++i) {
    BodyDefinition ball = Ball({2.0 * i, 0, 1}, 1);
    ball.friction = 0;
    ball.restitution = 1;
    if (i < kIncoming) ball.linear_velocity_W.x() = 1;
    world.Add(ball);
  }
  const StepReport report = testing::Step(&world, kDt);
  EXPECT_GE(report.bounces, kIncoming * (kBalls - kIncoming));
  for (int i = 0; i < kBalls; ++i)
    EXPECT_NEAR(world.body(i + 1).linear_velocity_W.x(), i < kBalls - kIncoming ? 0 : 1, 1e-5) << i;
}

// A heap that falls, with and without: rest by the same time, energy only falls, every answer certified.
TEST(SlightCollisions, HeapComesToRestAllTheSame) {
  for (const bool merged : {true, false}) {
    SCOPED_TRACE(merged);
    World world(Awake(merged));
    world.Add(Floor(0.5, 0.2));
    testing::AddWalls(&world, 2.1, 2, 1);
    for (int i = 0; i < 24; ++i) {
      BodyDefinition cube = Cube({0.3 * (i % 3), 0.4 * (i % 2), 1 + 1.8 * i}, 0.5, 0.2);
      cube.rotation_WB = testing::Turn(0.7 * i, Vector3(1, 0.3 * i, 2));
      world.Add(cube);
    }
    std::int64_t taken = 0;
    double worst = 0, energy = Energy(world.bodies());
    for (int frame = 0; frame < 900; ++frame) {
      const StepReport report = testing::Step(&world, kDt);
      taken += Merged(report);
      EXPECT_EQ(report.static_qp.failed + report.collision_qp.failed, 0);
      worst = std::max(worst, report.certificate.dual);
      if (frame % 10 == 9) {
        const double now = Energy(world.bodies());
        EXPECT_LT(now, energy + 1e-3 * 24) << frame;
        energy = now;
      }
    }
    EXPECT_EQ(taken > 5, merged) << taken;
    EXPECT_LT(worst, 1e-5);
    double fastest = 0;
    for (const Body& body : world.bodies()) fastest = std::max(fastest, body.linear_velocity_W.norm());
    EXPECT_LT(fastest, 1e-3);
  }
}

}  // namespace
}  // namespace islet
