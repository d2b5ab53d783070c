// Collisions in crowds that are over within the step: what carries takes them along. What is no such collision is still a blow.
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

Settings Awake() {
  Settings settings = testing::AsCrowd({});  // small groups have blows, however slight
  settings.freezing = Freezing::kOff;
  settings.threads = 1;
  return settings;
}

int Blows(const StepReport& report) { return report.bounces + report.collision_qp.solved; }

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
  contact.restitution = 1;
  EXPECT_EQ(SlightApproach(contact, gravity, kDt), 0);
  contact.restitution = 0;
  EXPECT_EQ(SlightApproach(contact, Vector3::Zero(), kDt), 0) << "without gravity nothing is slight";
}

// Cubes in the air, the middle one spinning: they fall like one, and keep their momenta.
TEST(SlightCollisions, NotInFreeFall) {
  World world(Awake());
  for (int i = 0; i < 9; ++i) {
    BodyDefinition cube = Cube({static_cast<double>(i % 3), static_cast<double>(i / 3), 100});
    if (i == 4) cube.angular_velocity_W = {0.3, 0.2, 1};
    world.Add(cube);
  }
  const Vector3 spin = testing::AngularMomentum(world.bodies());
  for (int frame = 0; frame < 60; ++frame) EXPECT_EQ(Blows(testing::Step(&world, kDt)), 0);
  Vector3 centre = Vector3::Zero();
  for (const Body& body : world.bodies()) centre += body.position_W / 9;
  EXPECT_LT((centre - Vector3(1, 1, 100 - 0.5 * kGravity)).norm(), 1e-9);
  const Vector3 arm = Vector3(1, 1, 100).cross(9 * Vector3(0, 0, -kGravity));  // torque of the weight about the origin
  EXPECT_LT((testing::AngularMomentum(world.bodies()) - spin - arm).norm(), 1e-9);
}

// A row that slides into a wall without friction: nothing presses it there, so it comes back.
TEST(SlightCollisions, NotAgainstAWallThatNothingPressesAt) {
  World world(Awake());
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

// By hand: the floor stops m (u + g dt) and rubs half of that.
TEST(SlightCollisions, SlidingRowByHand) {
  const double u = 0.3 * kFall, stopped = u + kFall;
  World world = SlidingRow(Awake(), 2, u);
  EXPECT_EQ(Blows(testing::Step(&world, kDt)), 0);
  for (int i = 1; i <= 5; ++i) {
    const Body& cube = world.body(i);
    EXPECT_NEAR(cube.linear_velocity_W.x(), 2 - 0.5 * stopped, 2e-6);
    EXPECT_NEAR(cube.linear_velocity_W.z(), 0, 2e-6);
    EXPECT_LT(cube.angular_velocity_W.norm(), 1e-5);
    EXPECT_LT((ImpulseOn(world, i) - Vector3(-0.5, 0, 1) * stopped).norm(), 2e-6);
    EXPECT_NEAR(cube.position_W.z(), 0.5, 1e-7);
    EXPECT_NEAR(cube.position_W.x(), kDt * (2 - 0.25 * (2 * u + kFall)),
                1e-7);  // the gap closes: mean velocity 0 along the normal
  }
}

// Frozen bodies and a wall that comes slowly: they wake, and are pushed with its speed.
TEST(SlightCollisions, AWallPushesWhatWasFrozen) {
  Settings settings = Awake();
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
  for (int frame = 0; frame < 180; ++frame) {
    testing::Step(&world, kDt);
    if (frame < 130) continue;  // it arrives after 2 s
    for (int i = 1; i <= 6; ++i) ASSERT_NEAR(world.body(i).linear_velocity_W.x(), 1e-3, 1e-6) << frame;
  }
}

TEST(SlightCollisions, OnTheOtherSideOfTheLimitItIsACollision) {
  for (const auto& [restitution, approach, slight] :
       {std::tuple{0.0, 0.99, true},
        {0.0, 1.01, true},  // without restitution nothing is lost by carrying
        {0.2, 0.19, true},
        {0.2, 0.21, false},
        {0.9, 5e-3, true},
        {0.9, 6e-3, false},
        {1.0, 1e-3, false}}) {
    SCOPED_TRACE(::testing::Message() << "e = " << restitution << ", " << approach << " g dt");
    World world = SlidingRow(Awake(), 0, approach * kFall, restitution);
    EXPECT_EQ(Blows(testing::Step(&world, kDt)) == 0, slight);
  }
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

// Momentum is kept, the heap answers, and what falls bounces off it.
TEST(SlightCollisions, ABlowOnAHeap) {
  const Layer layer(Awake(), 0.2, false);
  EXPECT_GT(Blows(layer.report), 0);
  EXPECT_LE(layer.report.certificate.dual, 1e-6);
  for (int i = 0; i <= kSide * kSide; ++i) {
    const Vector3 weight = Vector3(0, 0, -kGravity * kDt),
                  gained = layer.cube(i).linear_velocity_W - layer.before[i + 1].linear_velocity_W;
    EXPECT_LT((ImpulseOn(layer.world, i + 1) + weight - gained).norm(), 1e-12) << i;
  }
  EXPECT_GT((layer.cube(kSide * kSide).linear_velocity_W - Vector3(0.5, 0.2, -3)).norm(), 2);
}

TEST(SlightCollisions, WhatLandsFlatOnAHeapDoesNotSpin) {
  const Layer layer(Awake(), 0.5, true);
  EXPECT_GT(layer.report.bounces, 0);
  EXPECT_GT(layer.cube(kSide * kSide).linear_velocity_W.z(), 0);
  EXPECT_LT(layer.cube(kSide * kSide).angular_velocity_W.norm(), 1e-5);
}

// Five balls into a long row on a floor push out five: elastic blows have more bounces than heaps.
TEST(SlightCollisions, ElasticRowsPassOnBlowsHoweverLong) {
  Settings settings = Awake();
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

// A heap that falls: energy only falls, every answer is certified, and it comes to rest.
TEST(SlightCollisions, HeapComesToRest) {
  World world(Awake());
  world.Add(Floor(0.5, 0.2));
  testing::AddWalls(&world, 2.1, 2, 1);
  for (int i = 0; i < 24; ++i) {
    BodyDefinition cube = Cube({0.3 * (i % 3), 0.4 * (i % 2), 1 + 1.8 * i}, 0.5, 0.2);
    cube.rotation_WB = testing::Turn(0.7 * i, Vector3(1, 0.3 * i, 2));
    world.Add(cube);
  }
  double worst = 0, energy = Energy(world.bodies());
  for (int frame = 0; frame < 900; ++frame) {
    const StepReport report = testing::Step(&world, kDt);
    EXPECT_EQ(report.static_qp.failed + report.collision_qp.failed, 0);
    worst = std::max(worst, report.certificate.dual);
    const double now = Energy(world.bodies());
    EXPECT_LT(now, energy + 1e-6 * energy) << frame;
    energy = now;
  }
  EXPECT_LT(worst, 1e-5);
  double fastest = 0;
  for (const Body& body : world.bodies()) fastest = std::max(fastest, body.linear_velocity_W.norm());
  EXPECT_LT(fastest, 1e-3);
}

}  // namespace
}  // namespace islet
