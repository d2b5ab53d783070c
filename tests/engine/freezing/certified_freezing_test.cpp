// Certified freezing as a user meets it: through World.
#include "engine/freezing/certified_freezing.h"

#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Ball;
using testing::Cube;
using testing::CubeOnIncline;
using testing::Floor;
using testing::ImpulseOn;
using testing::kGravity;
using testing::StepTimes;
using testing::Turn;

constexpr double kDt = 1.0 / 60;

Settings OneThread() {
  Settings settings;
  settings.threads = 1;
  return settings;
}

bool AllFrozen(const World& world) {
  for (const Body& b : world.bodies())
    if (b.kind == BodyKind::kDynamic && !b.removed && !b.frozen) return false;
  return true;
}

int FramesUntilFrozen(World* world, int most, double dt = kDt) {
  for (int frame = 1; frame <= most; ++frame) {
    testing::Step(world, dt);
    if (AllFrozen(*world)) return frame;
  }
  return most + 1;
}

// A stack of n cubes, frozen. Body 0 is the floor.
World FrozenStack(int n, double friction = 0.5, const Settings& settings = OneThread()) {
  World world(settings);
  world.Add(Floor(friction));
  for (int i = 0; i < n; ++i) world.Add(Cube({0, 0, i + 0.5}, friction));
  EXPECT_LE(FramesUntilFrozen(&world, 60), 60);
  return world;
}

TEST(CertifiedFreezing, CubeOnTheFloorFreezesWithinAFifthOfASecond) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    World world(OneThread());
    world.Add(Floor());
    world.Add(Cube({0, 0, 0.5}));
    EXPECT_LE(FramesUntilFrozen(&world, 1000, dt) * dt, 0.2) << dt;
    EXPECT_GE(world.time(), 0.1 - dt);
    EXPECT_EQ(world.body(1).linear_velocity_W, Vector3::Zero());
  }
}

// It would be a wall in one frame and wake in the next.
TEST(CertifiedFreezing, DoesNotFreezeWhileItsLoadChanges) {
  World world(OneThread());
  world.Add(Floor());
  world.Add(Cube({0, 0, 0.5}));
  for (int frame = 0; frame < 60; ++frame) {
    world.SetForce(1, {0, 0, frame % 2 == 0 ? -0.5 * kGravity : 0}, Vector3::Zero());
    testing::Step(&world, kDt);
    EXPECT_FALSE(world.body(1).frozen) << frame;
  }
  EXPECT_LE(FramesUntilFrozen(&world, 60), 8);
}

// A ball of a gram rolls along a slab at rest: the slab is a wall, and what it stands on carries both.
TEST(CertifiedFreezing, SlabUnderARollingBallRests) {
  World world(testing::AsCrowd(OneThread()));
  world.Add(Floor());
  world.Add({.shape = Shape::Box({10, 1, 0.1}), .mass = 10, .position_W = {0, 0, 0.1}, .friction = 0.5});
  BodyDefinition ball = Ball({-3, 0, 0.3}, 0.1);
  ball.mass = 1e-3;
  ball.linear_velocity_W = {1, 0, 0};
  ball.angular_velocity_W = {0, 10, 0};
  world.Add(ball);
  for (int frame = 1; frame <= 60; ++frame) {
    testing::Step(&world, kDt);
    EXPECT_FALSE(world.body(2).frozen);
    if (frame < 10) continue;
    EXPECT_TRUE(world.body(1).frozen) << frame;
    EXPECT_NEAR(ImpulseOn(world, 0).z(), -10.001 * kGravity * kDt, 1e-7);
    EXPECT_NEAR(ImpulseOn(world, 1).z(), 10 * kGravity * kDt, 1e-7);
  }
  EXPECT_NEAR(world.body(2).position_W.x(), -2, 1e-6);
}

// A ball without friction slides along a plank that rests on a pedestal, and beyond its edge, where the plank's weight times 0.5 m holds
// the ball up to 0.5 m farther out.
TEST(CertifiedFreezing, PlankTipsWhereABallSlidesTooFarOut) {
  Settings freezes = testing::AsCrowd(OneThread());
  Settings never = freezes;
  never.freezing = Freezing::kOff;
  World worlds[2] = {World(freezes), World(never)};
  for (World& world : worlds) {
    BodyDefinition pedestal = Cube({0, 0, 0.5});
    pedestal.kind = BodyKind::kFixed;
    pedestal.mass.reset();
    world.Add(pedestal);
    world.Add({.shape = Shape::Box({2, 0.5, 0.1}), .mass = 1, .position_W = {0, 0, 1.1}, .friction = 0.5});
    BodyDefinition ball = Ball({0, 0, 1.7});
    ball.friction = 0;
    ball.linear_velocity_W = {0.5, 0, 0};
    world.Add(ball);
  }
  int rests = 0;
  for (int frame = 1; frame <= 150; ++frame) {
    for (World& world : worlds) testing::Step(&world, kDt);
    const double x = worlds[0].body(2).position_W.x();
    rests += worlds[0].body(1).frozen;
    EXPECT_FALSE(x > 1.01 && worlds[0].body(1).frozen) << x;
    for (const int i : {1, 2})
      EXPECT_LT((worlds[0].body(i).position_W - worlds[1].body(i).position_W).norm(), 1e-5) << frame;
  }
  EXPECT_GE(rests, 100);  // of the 120 until then
  EXPECT_GT(worlds[0].body(1).angular_velocity_W.y(), 0.05);
}

// A pile that is struck wakes as a whole, before the blow is resolved, moves as one that was never frozen, and has its impulses explain
// what it does. In the same frame what the blow left at rest freezes again.
// The same with its tail at an upstand, which it touches and does not press. Pressed hard enough between that and the table the plank would be
// held by friction at its tail; nothing presses it there.
TEST(CertifiedFreezing, PlankTipsThoughItsTailTouchesAnUpstand) {
  constexpr double kPlank = 10, kBall = 8, kOver = 0.2 * kPlank / kBall;  // [m] where it tips
  for (const double rate : {30.0, 60.0, 240.0}) {
    World world(testing::AsCrowd(OneThread()));
    world.Add({.shape = Shape::Box({0.8, 0.2, 0.2}),
               .kind = BodyKind::kFixed,
               .position_W = {-0.8, 0, 0.2},
               .friction = 0.6});
    world.Add({.shape = Shape::Box({0.1, 0.2, 0.1}),
               .kind = BodyKind::kFixed,
               .position_W = {-0.85, 0, 0.5001},
               .friction = 0.6});
    const int plank = world.Add(
        {.shape = Shape::Box({0.55, 0.15, 0.02}), .mass = kPlank, .position_W = {-0.2, 0, 0.42}, .friction = 0.6});
    BodyDefinition ball{
        .shape = Shape::Sphere(0.05), .mass = kBall, .position_W = {kOver - 0.05, 0, 0.49}, .friction = 0.6};
    ball.linear_velocity_W = {0.05, 0, 0};
    ball.angular_velocity_W = {0, 1, 0};
    const int number = world.Add(ball);
    const auto tipped = [&] { return world.body(plank).angular_velocity_W.norm() > 1e-4; };
    while (world.body(number).position_W.x() < kOver - 2e-3) testing::Step(&world, 1 / rate);
    EXPECT_FALSE(tipped()) << rate;
    while (world.body(number).position_W.x() < kOver + 0.01) testing::Step(&world, 1 / rate);
    EXPECT_TRUE(tipped()) << rate;
  }
}

// The same with the plank on a wall of bricks, all of one island. What cannot be held gives way, and does not wake the others.
TEST(CertifiedFreezing, PlankThatTipsLeavesTheWallFrozen) {
  World world(testing::AsCrowd(OneThread()));
  world.Add(Floor());
  for (int layer = 0; layer < 6; ++layer)
    for (int k = 0; k < 6 - layer % 2; ++k)
      world.Add({.shape = Shape::Box({0.45, 0.3, 0.2}),
                 .mass = 1,
                 .position_W = {-k - 0.5 * (layer % 2), 0, 0.2 + 0.4 * layer},
                 .friction = 0.5});
  const int plank =
      world.Add({.shape = Shape::Box({1, 0.3, 0.05}), .mass = 1, .position_W = {-0.5, 0, 2.45}, .friction = 0.5});
  const int wall = plank - 1;
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  BodyDefinition ball = Ball({-0.5, 0, 2.7}, 0.2);
  ball.friction = 0;
  ball.linear_velocity_W = {0.5, 0, 0};
  world.Add(ball);
  int steps = 0;
  while (world.body(plank).angular_velocity_W.norm() < 1e-4 && ++steps < 120) {
    const StepReport report = testing::Step(&world, kDt);
    EXPECT_GE(report.frozen, wall - 2) << steps;
    EXPECT_LT(report.largest_island_contacts, 20) << steps;  // those of the wall are hundreds
  }
  EXPECT_GT(steps, 40);
  EXPECT_LT(steps, 120) << "it never tipped";
}

TEST(CertifiedFreezing, PileThatIsStruckMovesAsIfItHadNeverBeenFrozen) {
  Settings freezes = testing::AsCrowd(OneThread());
  freezes.effort = qp::kThoroughEffort;
  Settings never = freezes;
  never.freezing = Freezing::kOff;
  World worlds[2] = {World(freezes), World(never)};
  for (World& world : worlds) {
    world.Add(Floor());
    for (int i = 0; i < 25; ++i) world.Add(Cube({1.001 * (i % 5), 1.001 * (i / 5), 0.5}));
    for (int i = 0; i < 16; ++i) world.Add(Cube({0.5 + 1.001 * (i % 4), 0.5 + 1.001 * (i / 4), 1.5}));
    StepTimes(&world, 30, kDt);
    BodyDefinition ball = Ball({1.501, 1.501, 2.6}, 0.5);  // on the middle of a cube
    ball.linear_velocity_W = {0, 0, -3};
    world.Add(ball);
  }
  EXPECT_TRUE(worlds[0].body(1).frozen && worlds[0].body(41).frozen);
  bool touched = false;
  for (int frame = 0; frame < 30; ++frame) {
    for (World& world : worlds) testing::Step(&world, kDt);
    touched = touched || worlds[0].body(42).linear_velocity_W.z() > -2;
    for (int i = 1; i <= 42; ++i)
      EXPECT_LT((worlds[0].body(i).position_W - worlds[1].body(i).position_W).norm(), 1e-4) << frame << ", " << i;
  }
  EXPECT_TRUE(touched);
}

// What freezes is held by the impulses that are told, also where a step that ended in rest moved it before.
TEST(CertifiedFreezing, WhatIsFrozenIsHeldInEveryStep) {
  constexpr int kBoxes = 60;
  World world(OneThread());
  world.Add(Floor());
  const auto share = [](int i, double factor) { return i * factor - std::floor(i * factor); };
  for (int i = 0; i < kBoxes; ++i) {
    const Vector3 half(0.1 + 0.3 * share(i, 0.6180339), 0.1 + 0.3 * share(i, 0.7548776),
                       0.1 + 0.3 * share(i, 0.5698402));
    world.Add({.shape = Shape::Box(half),
               .position_W = {2.4 * share(i, 0.4142135) - 1.2, 2.4 * share(i, 0.7320508) - 1.2, 0.5 + 0.85 * i},
               .friction = 0.5,
               .restitution = 0});
  }
  int held = 0;
  for (int step = 0; step < 220; ++step) {
    const std::vector<Body> before(world.bodies().begin(), world.bodies().end());
    testing::Step(&world, kDt);
    for (int i = 1; i <= kBoxes; ++i) {
      if (!before[i].frozen || !world.body(i).frozen) continue;
      const double weight = before[i].mass * kGravity * kDt;
      EXPECT_LT((ImpulseOn(world, i) - Vector3(0, 0, weight)).norm(), 1e-6 * weight) << step << " " << i;
      ++held;
    }
  }
  EXPECT_GT(held, 500);
}

TEST(CertifiedFreezing, NeverFreezesInTheAirOrAtTheTopOfAFlight) {
  World world(OneThread());
  world.Add(Floor());
  BodyDefinition cube = Cube({0, 0, 5});
  cube.linear_velocity_W = {0, 0, 0.5 * kGravity * kDt};  // stands still between two frames
  world.Add(cube);
  for (int i = 0; i < 30; ++i) {
    testing::Step(&world, kDt);
    EXPECT_FALSE(world.body(1).frozen);
  }
  world.SetGravity(Vector3::Zero());
  world.SetVelocity(1, Vector3::Zero(), Vector3::Zero());
  StepTimes(&world, 60);
  EXPECT_FALSE(world.body(1).frozen) << "a body that touches nothing is held by nothing";
}

// Frozen bodies still carry and weigh.
TEST(CertifiedFreezing, FloorUnderAFrozenStackCarriesAllOfIt) {
  World world = FrozenStack(8);
  for (int i = 0; i < 5; ++i) {
    testing::Step(&world, kDt);
    ASSERT_TRUE(AllFrozen(world));
    EXPECT_NEAR(ImpulseOn(world, 0).z(), -8 * kGravity * kDt, 1e-3 * kGravity * kDt);
    for (int body = 1; body <= 8; ++body)
      EXPECT_NEAR((ImpulseOn(world, body) - Vector3(0, 0, kGravity * kDt)).norm(), 0, 2e-3 * kGravity * kDt);
  }
  testing::Step(&world, kDt / 2);  // impulses are per time
  EXPECT_NEAR(ImpulseOn(world, 0).z(), -4 * kGravity * kDt, 1e-3 * kGravity * kDt);
  EXPECT_TRUE(AllFrozen(world));
}

// Falls in the frame in which the support is gone, by the full g dt.
TEST(CertifiedFreezing, FallsInTheFrameInWhichItsSupportIsRemoved) {
  World world = FrozenStack(3);
  world.Remove(1);
  const StepReport report = testing::Step(&world, kDt);
  EXPECT_EQ(report.woken, 2);
  for (const int body : {2, 3}) {
    EXPECT_FALSE(world.body(body).frozen);
    EXPECT_NEAR(world.body(body).linear_velocity_W.z(), -kGravity * kDt, 1e-6);
    EXPECT_NEAR(world.body(body).position_W.z(), body - 0.5 - 0.5 * kGravity * kDt * kDt, 1e-6);
  }
}

TEST(CertifiedFreezing, FallsWhenAFixedSupportIsRemoved) {
  World world(OneThread());
  BodyDefinition table = Cube({0, 0, 0});
  table.kind = BodyKind::kFixed;
  table.mass.reset();
  world.Add(table);
  world.Add(Cube({0, 0, 1}));
  world.Add(Cube({0, 0, 2}));
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  world.Remove(0);
  testing::Step(&world, kDt);
  for (const int body : {1, 2}) EXPECT_NEAR(world.body(body).linear_velocity_W.z(), -kGravity * kDt, 1e-6);
}

TEST(CertifiedFreezing, FallsWhenItsSupportIsTeleportedAway) {
  World world = FrozenStack(3);
  world.Teleport(1, {5, 0, 0.5}, Quaternion::Identity());
  testing::Step(&world, kDt);
  for (const int body : {2, 3}) EXPECT_NEAR(world.body(body).linear_velocity_W.z(), -kGravity * kDt, 1e-6);
}

// Where each step takes away next to nothing of it, what rests follows all the same, in groups and in crowds.
TEST(CertifiedFreezing, FollowsASupportThatIsLoweredBitByBit) {
  for (const bool crowd : {false, true}) {
    World world(crowd ? testing::AsCrowd(OneThread()) : OneThread());
    BodyDefinition slab = Cube({0, 0, 0});
    slab.kind = BodyKind::kKinematic;
    slab.mass.reset();
    world.Add(slab);
    for (const double z : {1.0, 2.0}) world.Add(Cube({0, 0, z}));
    ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
    for (int k = 1; k <= 300; ++k) {
      world.Teleport(0, {0, 0, -5e-5 * k}, Quaternion::Identity());
      testing::Step(&world, kDt);
      EXPECT_NEAR(world.body(1).position_W.z() - world.body(0).position_W.z(), 1, 1e-3) << crowd << " " << k;
    }
  }
}

// Half of it is left under the load: the rest has to tip.
TEST(CertifiedFreezing, TipsWhenItsSupportIsShiftedBeyondItsCentre) {
  World world = FrozenStack(2);
  world.Teleport(1, {0.6, 0, 0.5}, Quaternion::Identity());
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(2).frozen);
  EXPECT_LT(world.body(2).angular_velocity_W.y(), -1e-3);
}

TEST(CertifiedFreezing, StaysWhenTheSupportIsShiftedALittle) {
  World world = FrozenStack(2);
  world.Teleport(1, {0.2, 0, 0.5}, Quaternion::Identity());
  StepTimes(&world, 60);
  EXPECT_TRUE(AllFrozen(world));
  EXPECT_NEAR((world.body(2).position_W - Vector3(0, 0, 1.5)).norm(), 0, 1e-4);
}

TEST(CertifiedFreezing, GravityTurnedBeyondTheFrictionAngleSlidesInThatFrame) {
  World world = FrozenStack(1);
  const double turn = 30 * M_PI / 180;  // tan = 0.577 > 0.5
  world.SetGravity(kGravity * Vector3(std::sin(turn), 0, -std::cos(turn)));
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(1).frozen);
  EXPECT_NEAR(world.body(1).linear_velocity_W.x(), kGravity * (std::sin(turn) - 0.5 * std::cos(turn)) * kDt, 1e-5);
}

TEST(CertifiedFreezing, GravityTurnedBelowTheFrictionAngleLeavesItFrozen) {
  World world = FrozenStack(3);
  for (const double degrees :
       {5.0, 15.0, 26.0}) {  // tan 26 = 0.488; tips only at tan = 1/3 for three cubes, so one by one
    World cube = FrozenStack(1);
    cube.SetGravity(kGravity * Vector3(std::sin(degrees * M_PI / 180), 0, -std::cos(degrees * M_PI / 180)));
    for (int i = 0; i < 30; ++i) {
      const StepReport report = cube.Step(kDt);
      EXPECT_EQ(report.woken, 0) << degrees;
    }
    EXPECT_TRUE(AllFrozen(cube)) << degrees;
    EXPECT_NEAR(cube.body(1).position_W.x(), 0, 1e-6) << degrees;
  }
  world.SetGravity(kGravity * Vector3(std::sin(0.25), 0, -std::cos(0.25)));  // tan = 0.255 < 1/3
  StepTimes(&world, 30);
  EXPECT_TRUE(AllFrozen(world));
  world.SetGravity(kGravity * Vector3(std::sin(0.36), 0, -std::cos(0.36)));  // tan = 0.376 > 1/3: the tower tips
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(3).frozen);
}

TEST(CertifiedFreezing, SlowPushBelowTheThresholdIsHeldAboveItSlides) {
  World world = FrozenStack(1);
  for (double push = 0.05; push < 0.99; push += 0.05) {  // of mu m g
    world.SetForce(1, {push * 0.5 * kGravity, 0, 0}, Vector3::Zero());
    testing::Step(&world, kDt);
    EXPECT_TRUE(world.body(1).frozen) << push;
  }
  world.SetForce(1, {0.99 * 0.5 * kGravity, 0, 0}, Vector3::Zero());
  StepTimes(&world, 10);
  EXPECT_TRUE(world.body(1).frozen);
  EXPECT_EQ(world.body(1).linear_velocity_W, Vector3::Zero());
  world.SetForce(1, {1.01 * 0.5 * kGravity, 0, 0}, Vector3::Zero());
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(1).frozen);
  EXPECT_NEAR(world.body(1).linear_velocity_W.x(), 0.01 * 0.5 * kGravity * kDt, 1e-5);
}

// T3: the same in every direction.
TEST(CertifiedFreezing, PushThresholdIsTheSameInEveryDirection) {
  for (int k = 0; k < 16; ++k) {
    World world = FrozenStack(1);
    const Vector3 direction(std::cos(k * M_PI / 8 + 0.1), std::sin(k * M_PI / 8 + 0.1), 0);
    world.SetForce(1, 0.985 * 0.5 * kGravity * direction, Vector3::Zero());
    StepTimes(&world, 5);
    EXPECT_TRUE(world.body(1).frozen) << k;
    world.SetForce(1, 1.015 * 0.5 * kGravity * direction, Vector3::Zero());
    testing::Step(&world, kDt);
    EXPECT_FALSE(world.body(1).frozen) << k;
  }
}

TEST(CertifiedFreezing, TorqueThatTipsWakes) {
  World world = FrozenStack(1);
  world.SetForce(1, Vector3::Zero(), {0, 0.45 * kGravity, 0});  // the edge holds m g / 2
  StepTimes(&world, 5);
  EXPECT_TRUE(world.body(1).frozen);
  world.SetForce(1, Vector3::Zero(), {0, 0.55 * kGravity, 0});
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(1).frozen);
  EXPECT_GT(world.body(1).angular_velocity_W.y(), 1e-3);
}

World FrozenOnKinematic(int n) {
  World world(OneThread());
  BodyDefinition plate{.shape = Shape::Box({5, 5, 0.5}),
                       .kind = BodyKind::kKinematic,
                       .position_W = {0, 0, -0.5},
                       .friction = 0.5,
                       .restitution = 0};
  world.Add(plate);
  for (int i = 0; i < n; ++i) world.Add(Cube({0, 0, i + 0.5}));
  EXPECT_LE(FramesUntilFrozen(&world, 60), 60);
  return world;
}

TEST(CertifiedFreezing, KinematicFloorThatStartsTakesItsLoadAlong) {
  World world = FrozenOnKinematic(2);
  world.SetVelocity(0, {0.05, 0, 0}, Vector3::Zero());  // slow: mu g dt = 0.08 m/s can follow
  testing::Step(&world, kDt);
  for (const int body : {1, 2}) {
    EXPECT_FALSE(world.body(body).frozen);
    EXPECT_NEAR(world.body(body).linear_velocity_W.x(), 0.05, 1e-4);
  }
  StepTimes(&world, 60);
  EXPECT_NEAR(world.body(2).position_W.x() - world.body(0).position_W.x(), 0, 2e-3);
}

// Slower than what wakes a frozen body, but it never stops: what lies on it and is put to rest again and again must not stay
// behind by more than the way that counts as standing still, 1e-3 radii. (The upper ones stayed where they were.)
TEST(CertifiedFreezing, KinematicFloorThatCreepsLeavesNothingBehind) {
  for (const double speed : {5e-5, 1.5e-4, 1e-3}) {
    World world = FrozenOnKinematic(2);
    world.SetVelocity(0, {speed, 0, 0}, Vector3::Zero());
    StepTimes(&world, static_cast<int>(2e-3 / speed / kDt));
    EXPECT_NEAR(world.body(0).position_W.x(), 2e-3, 2e-5);
    for (const int body : {1, 2}) {
      const double behind = world.body(0).position_W.x() - world.body(body).position_W.x();
      EXPECT_NEAR(behind, 0, body == 1 ? 2e-5 : 1.01e-3 * world.body(body).radius) << speed << " " << body;
    }
  }
}

// The upper cubes were walls towards which the lowest was carried: every static problem was infeasible.
TEST(CertifiedFreezing, KinematicFloorThatCreepsUpLiftsAllThatStandsOnIt) {
  for (const double speed : {1e-7, 1e-6, 1e-5}) {
    World world = FrozenOnKinematic(3);
    world.SetVelocity(0, {0, 0, speed}, Vector3::Zero());
    for (int frame = 0; frame < 120; ++frame) {
      const StepReport report = testing::Step(&world, kDt);
      EXPECT_EQ(report.static_qp.failed, 0) << speed << " " << frame;
      EXPECT_EQ(report.collision_qp.failed, 0) << speed << " " << frame;
    }
    for (const int body : {1, 2, 3}) EXPECT_NEAR(world.body(body).linear_velocity_W.z(), speed, 1e-2 * speed) << body;
  }
}

TEST(CertifiedFreezing, KinematicFloorThatSinksLetsItsLoadFall) {
  World world = FrozenOnKinematic(1);
  world.SetVelocity(0, {0, 0, -3}, Vector3::Zero());
  testing::Step(&world, kDt);
  EXPECT_NEAR(world.body(1).linear_velocity_W.z(), -kGravity * kDt, 1e-5);
}

TEST(CertifiedFreezing, KinematicFloorThatTurnsTakesItsLoadAlong) {
  World world = FrozenOnKinematic(1);
  world.SetVelocity(0, Vector3::Zero(), {0, 0, 0.05});
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(1).frozen);
  EXPECT_NEAR(world.body(1).angular_velocity_W.z(), 0.05, 1e-4);
}

// A wall that arrives from a distance within one step: not a contact yet, and the motion could not stop it.
TEST(CertifiedFreezing, WakesBeforeAKinematicWallArrives) {
  World world(OneThread());
  world.Add(Floor());
  world.Add(Cube({0, 0, 0.5}));
  BodyDefinition wall = Cube({2, 0, 0.6});
  wall.kind = BodyKind::kKinematic;
  world.Add(wall);
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  world.SetVelocity(2, {-3.1, 0, 0}, Vector3::Zero());
  for (int frame = 0; frame < 40; ++frame) {
    testing::Step(&world, kDt);
    const double distance = world.body(2).position_W.x() - world.body(1).position_W.x();
    ASSERT_GE(distance, 1 - 2 * world.settings().overlap_tolerance) << frame;
  }
  EXPECT_LT(world.body(1).position_W.x(), -0.5);
}

// Friction lowered under a frozen body: the impulses still balance, but they have left the cone.
TEST(CertifiedFreezing, SlidesInTheFrameInWhichFrictionIsTakenAway) {
  const double incline = std::atan(0.4);
  World world(OneThread());
  world.Add(Floor(0.5, 0, incline));
  world.Add(CubeOnIncline(incline, 0.5));
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  world.SetMaterialCallback([](const Contact&, const Body&, const Body&) { return Material{0.1, 0}; });
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(1).frozen);
  EXPECT_NEAR(world.body(1).linear_velocity_W.norm(), kGravity * (std::sin(incline) - 0.1 * std::cos(incline)) * kDt,
              1e-4);
}

// A small group wakes; a crowd's stack is a wall that can hold it.
TEST(CertifiedFreezing, LoadPlacedOnAFrozenStackIsCarried) {
  for (const bool crowd : {false, true}) {
    World world = FrozenStack(4, 0.5, crowd ? testing::AsCrowd(OneThread()) : OneThread());
    const int load = world.Add(Cube({0.1, 0, 4.5}));
    testing::Step(&world, kDt);
    EXPECT_NEAR(ImpulseOn(world, 0).z(), -5 * kGravity * kDt, 2e-3 * kGravity * kDt);
    for (int body = 1; body <= 4; ++body) EXPECT_EQ(world.body(body).frozen, crowd) << body;
    EXPECT_LE(FramesUntilFrozen(&world, 30), 30);
    EXPECT_NEAR((world.body(load).position_W - Vector3(0.1, 0, 4.5)).norm(), 0, 1e-4);
  }
}

// The end of a frozen plank: holds m, tips under more than its own moment allows.
TEST(CertifiedFreezing, LoadThatTipsAFrozenPlankWakesIt) {
  World world(OneThread());
  world.Add(Floor());
  BodyDefinition pedestal = Cube({0, 0, 0.5});
  pedestal.kind = BodyKind::kFixed;
  pedestal.mass.reset();
  world.Add(pedestal);
  const int plank =
      world.Add({.shape = Shape::Box({2, 0.5, 0.1}), .mass = 1, .position_W = {0, 0, 1.1}, .restitution = 0});
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  BodyDefinition load = Cube({1.4, 0, 1.7});  // beyond the edge by 0.9 against the plank's 0.5
  world.Add(load);
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(plank).frozen);
  EXPECT_GT(world.body(plank).angular_velocity_W.y(), 1e-3);
}

TEST(CertifiedFreezing, NeighbourThatCarriesNothingMayGo) {
  World world(OneThread());
  world.Add(Floor());
  world.Add(Cube({0, 0, 0.5}));
  world.Add(Cube({1, 0, 0.5}));  // touches, loads nothing
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  world.Remove(2);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(testing::Step(&world, kDt).woken, 0);
  EXPECT_TRUE(world.body(1).frozen);
}

TEST(CertifiedFreezing, UnloadedStackStays) {
  World world = FrozenStack(5);
  world.Remove(5);
  EXPECT_EQ(testing::Step(&world, kDt).woken, 0);
  EXPECT_NEAR(ImpulseOn(world, 0).z(), -4 * kGravity * kDt, 2e-3 * kGravity * kDt);
}

// T25. A ball on a fixed ball is out of balance however little: it must roll off, not freeze.
TEST(CertifiedFreezing, BallOnABallRollsOff) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    for (const double angle : {0.1, 0.01, 0.001, 0.0001, 1e-5, 1e-6, 1e-7}) {
      World world(OneThread());
      BodyDefinition below = Ball(Vector3::Zero());
      below.kind = BodyKind::kFixed;
      below.mass.reset();
      world.Add(below);
      world.Add(Ball({std::sin(angle), 0, std::cos(angle)}));
      // theta'' = 5 g / (7 (R + r)) theta: it has left the ball at about acosh(1 / angle) / 2.65 s.
      const double most = (std::acosh(1 / angle) + 2) / std::sqrt(5 * kGravity / 7);
      while (world.time() < most && world.body(1).position_W.z() > 0) testing::Step(&world, dt);
      EXPECT_LT(world.body(1).position_W.z(), 0) << dt << " " << angle;
      EXPECT_NEAR(world.body(1).position_W.y(), 0, 1e-9);
    }
  }
}

// On an edge, 1e-6 rad off: the speed stays below that of a body at rest for a second, but it grows.
TEST(CertifiedFreezing, CubeBalancedOnAnEdgeFallsOver) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    World world(OneThread());
    world.Add(Floor());
    BodyDefinition cube = Cube({0, 0, 0});
    cube.rotation_WB = Turn(M_PI / 4 + 1e-6, Vector3::UnitY());
    cube.position_W.z() = std::sqrt(0.5) * std::cos(1e-6);
    world.Add(cube);
    StepTimes(&world, static_cast<int>(7 / dt), dt);
    EXPECT_NEAR(world.body(1).position_W.z(), 0.5, 1e-3) << dt;
  }
}

// A ball on a plane that leans by 5e-5 rad gains 6e-6 m/s in a step. It gains them in every step.
TEST(CertifiedFreezing, BallOnTheSlightestSlopeRolls) {
  for (const double lean : {5e-4, 5e-5, 5e-6}) {
    Settings settings = OneThread();
    settings.gravity = kGravity * Vector3(std::sin(lean), 0, -std::cos(lean));
    World world(settings);
    world.Add(Floor());
    world.Add(Ball({0, 0, 0.5}));
    StepTimes(&world, 120);
    EXPECT_NEAR(world.body(1).linear_velocity_W.x(), 5.0 / 7 * kGravity * lean * 2, 1e-3 * kGravity * lean) << lean;
  }
}

// Whether it rolls the ball or spins it: points brake no spin.
TEST(CertifiedFreezing, TheSlightestTorqueIsAnAcceleration) {
  const auto run = [](const Vector3& torque, const Vector3& spin) {
    World world(testing::AsCrowd(OneThread()));
    world.Add(Floor());
    BodyDefinition ball = Ball({0, 0, 0.5});
    ball.angular_velocity_W = spin;
    world.SetForce(world.Add(ball), Vector3::Zero(), torque);
    StepTimes(&world, 300, 1.0 / 30);
    return world.body(1).frozen;
  };
  EXPECT_FALSE(run({0, 0, 2e-8}, {0, 0, 0}));
  EXPECT_FALSE(run({0, 2e-8, 0}, {0, 0, 0}));
  EXPECT_FALSE(run({0, 2e-8, 0}, {0, 0, 1e-5}));
  EXPECT_FALSE(run({0, 2e-8, 2e-8}, {0, 0, 0}));
  EXPECT_FALSE(run({0, 0, 2e-3}, {0, 0, 0}));
}

// In a groove whose sides lean by 45 degrees the ball's axis passes through both contacts, and still it rolls along.
TEST(CertifiedFreezing, BallInAGrooveThatLeansByAHairRolls) {
  Settings settings = OneThread();
  constexpr double kLean = 5e-6;
  settings.gravity = kGravity * Vector3(std::sin(kLean), 0, -std::cos(kLean));
  World world(settings);
  for (const double side : {-1.0, 1.0}) {
    BodyDefinition wall{.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed};
    wall.rotation_WB = Turn(side * M_PI / 4, Vector3::UnitX());
    world.Add(wall);
  }
  world.Add(Ball({0, 0, 0.5 * std::sqrt(2.0)}));
  StepTimes(&world, 120);
  EXPECT_FALSE(world.body(2).frozen);
  EXPECT_GT(world.body(2).linear_velocity_W.x(), 0.4 * kGravity * kLean * 2);
}

TEST(CertifiedFreezing, GravityThatTurnsByAHairRollsABall) {
  World world(OneThread());
  world.Add(Floor());
  world.Add(Ball({0, 0, 0.5}));
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  const double lean = 1e-4;
  world.SetGravity(kGravity * Vector3(std::sin(lean), 0, -std::cos(lean)));
  testing::Step(&world, kDt);
  EXPECT_FALSE(world.body(1).frozen);
  EXPECT_NEAR(world.body(1).linear_velocity_W.x(), 5.0 / 7 * kGravity * lean * kDt, 1e-8);
}

// A blow of 20 kg at 10 m/s against one cube of a pyramid: all wake, and few move by more than what the solver's tolerance leaves.
TEST(CertifiedFreezing, BlowMovesWhatItHitsAndNothingElse) {
  World world(OneThread());
  world.Add(Floor());
  constexpr int kLayers = 6;
  constexpr double kPitch = 1.04;
  for (int layer = 0; layer < kLayers; ++layer) {
    const int side = kLayers - layer;
    for (int i = 0; i < side * side; ++i)
      world.Add(Cube({kPitch * (i / side - 0.5 * (side - 1)), kPitch * (i % side - 0.5 * (side - 1)), layer + 0.5}));
  }
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  BodyDefinition ball = Ball({-kPitch - 1, 0, 3.5});
  ball.mass = 20;
  ball.linear_velocity_W = {10, 0, 0};
  world.Add(ball);
  testing::Step(&world, kDt);
  int moving = 0;
  for (const Body& b : world.bodies()) {
    EXPECT_FALSE(b.frozen);
    moving += b.linear_velocity_W.norm() + b.angular_velocity_W.norm() > 1e-3;
  }
  EXPECT_GE(moving, 2);
  EXPECT_LE(moving, 9);  // of 92: those that are hit; the tenth has 7e-4 or 8e-4
}

// T26, Fig. 5: the blow wakes the whole row in the frame of the hit.
TEST(CertifiedFreezing, HitWakesTheWholeRowInOneFrame) {
  World world(OneThread());
  world.Add(Floor());
  for (int i = 0; i < 4; ++i) world.Add(Cube({static_cast<double>(i), 0, 0.5}));
  ASSERT_LE(FramesUntilFrozen(&world, 60), 60);
  BodyDefinition ball = Ball({-1.005, 0, 0.5});
  ball.linear_velocity_W = {6, 0, 0};
  ball.angular_velocity_W = {0, 12, 0};
  world.Add(ball);
  int woken = 0, frames = 0;
  for (; woken == 0 && frames < 10; ++frames) woken = testing::Step(&world, kDt).woken;
  EXPECT_EQ(woken, 4);
  for (int body = 1; body <= 4; ++body) EXPECT_GT(world.body(body).linear_velocity_W.x(), 0.1) << body;
}

// What wakes and freezes is counted, whether it is moved from blow to blow or with a crowd then.
TEST(CertifiedFreezing, ReportsAllThatWakeAndFreeze) {
  for (const int boxes : {4, 26}) {
    World world(OneThread());
    world.Add(Floor());
    const auto box = [&](double x, double z) {
      world.Add({.shape = Shape::Box({0.05, 0.05, 0.025}), .mass = 0.5, .position_W = {x, 0, z}, .restitution = 0.2});
    };
    for (int j = 0; j < boxes; ++j) box(0.101 * (j % 5), 0.025 + 0.05 * (j / 5));
    world.Add({.shape = Shape::Sphere(0.02), .mass = 0.3, .position_W = {-2, 0, 0.03}, .linear_velocity_W = {8, 0, 0}});
    int woken = 0;
    for (int frame = 0; frame < 360; ++frame) {
      const std::vector<Body> before(world.bodies().begin(), world.bodies().end());
      if (frame == 120) {
        world.Teleport(boxes + 1, {-0.2, 0, 0.03}, Quaternion::Identity());
        world.SetVelocity(boxes + 1, {8, 0, 0}, Vector3::Zero());
      }
      const StepReport report = testing::Step(&world, 1.0 / 240);
      int wakes = 0, freezes = 0;
      for (size_t i = 0; i < before.size(); ++i) {
        wakes += before[i].frozen && !world.body(static_cast<int>(i)).frozen;
        freezes += !before[i].frozen && world.body(static_cast<int>(i)).frozen;
      }
      EXPECT_EQ(report.woken, wakes) << boxes << ' ' << frame;
      EXPECT_EQ(report.newly_frozen, freezes) << boxes << ' ' << frame;
      woken += wakes;
    }
    EXPECT_GE(woken, boxes / 2) << boxes;
  }
}

// Equal to the run in which nothing was ever frozen. (The ball touches: across a gap it would first have to be stopped by the
// position update, which shares the push with a row that can move.)
TEST(CertifiedFreezing, HitRowMovesAsIfItHadNeverBeenFrozen) {
  std::vector<Vector3> ends[2];
  for (const bool freeze : {false, true}) {
    Settings settings = OneThread();
    settings.freezing = freeze ? Freezing::kCertified : Freezing::kOff;
    World world(settings);
    world.Add(Floor());
    for (int i = 0; i < 3; ++i) world.Add(Cube({static_cast<double>(i), 0, 0.5}));
    StepTimes(&world, 30);
    BodyDefinition ball = Ball({-1.0005, 0, 0.5});
    ball.linear_velocity_W = {3, 0, 0};
    world.Add(ball);
    StepTimes(&world, 12);
    for (int i = 1; i <= 4; ++i) ends[freeze].push_back(world.body(i).position_W);
  }
  for (size_t i = 0; i < ends[0].size(); ++i) EXPECT_NEAR((ends[0][i] - ends[1][i]).norm(), 0, 1e-3) << i;
}

// A pyramid of cubes freezes; without its bottom row nothing may float.
TEST(CertifiedFreezing, NothingFloatsWhenTheLowerHalfIsRemoved) {
  World world(OneThread());
  world.Add(Floor());
  std::vector<int> lower, upper;
  constexpr int kRows = 6;
  for (int row = 0; row < kRows; ++row)
    for (int i = 0; i < kRows - row; ++i)
      (row < kRows / 2 ? lower : upper).push_back(world.Add(Cube({1.05 * i + 0.525 * row, 0, row + 0.5})));
  ASSERT_LE(FramesUntilFrozen(&world, 120), 120);
  for (const int body : lower) world.Remove(body);
  testing::Step(&world, kDt);
  for (const int body : upper) {
    EXPECT_FALSE(world.body(body).frozen) << body;
    EXPECT_NEAR(world.body(body).linear_velocity_W.z(), -kGravity * kDt, 1e-4) << body;
  }
  StepTimes(&world, 300);
  for (const int body : upper) EXPECT_LT(world.body(body).position_W.z(), 3.1) << body;
  EXPECT_TRUE(AllFrozen(world));
}

// Edges of four cubes that share one line touch in any direction, a new one in each step. What balances them is found anew.
TEST(CertifiedFreezing, FlushBlocksFreezeAtOnceAndStayFrozen) {
  constexpr int kAlong = 6, kAcross = 2, kHigh = 3;  // more than a small island
  World world(OneThread());
  world.Add(Floor());
  for (int i = 0; i < kAlong * kAcross * kHigh; ++i)
    world.Add(Cube({static_cast<double>(i % kAlong), static_cast<double>(i / kAlong % kAcross),
                    0.5 + static_cast<double>(i / (kAlong * kAcross))}));
  EXPECT_LE(FramesUntilFrozen(&world, 60), 12);
  for (int frame = 0; frame < 120; ++frame) EXPECT_EQ(testing::Step(&world, kDt).woken, 0) << frame;
}

TEST(CertifiedFreezing, ResidualSpeedNeverSurvivesInAFrozenBody) {
  World world = FrozenStack(5);
  const std::vector<Body> before(world.bodies().begin(), world.bodies().end());
  StepTimes(&world, 600);
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(world.bodies()[i].position_W, before[i].position_W);
    EXPECT_EQ(world.bodies()[i].rotation_WB.coeffs(), before[i].rotation_WB.coeffs());
    EXPECT_EQ(world.bodies()[i].linear_velocity_W, Vector3::Zero());
  }
}

TEST(CertifiedFreezing, SetVelocityAndForceOnAFrozenBody) {
  World world = FrozenStack(2);
  world.SetVelocity(2, {1, 0, 0}, Vector3::Zero());
  EXPECT_FALSE(world.body(2).frozen);
  testing::Step(&world, kDt);
  EXPECT_NEAR(world.body(2).linear_velocity_W.x(), 1 - 0.5 * kGravity * kDt, 1e-4);
  for (const bool crowd : {false, true}) {
    World lifted = FrozenStack(2, 0.5, crowd ? testing::AsCrowd(OneThread()) : OneThread());
    lifted.SetForce(2, {0, 0, 1.5 * kGravity}, Vector3::Zero());
    testing::Step(&lifted, kDt);
    EXPECT_NEAR(lifted.body(2).linear_velocity_W.z(), 0.5 * kGravity * kDt, 1e-6);
    EXPECT_NEAR(testing::ImpulseOn(lifted, 1).z(), kGravity * kDt, 1e-6) << "the floor carries one";
  }
}

}  // namespace
}  // namespace islet
