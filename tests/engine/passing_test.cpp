#include "engine/passing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/narrow_phase.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Ball;
using testing::Floor;

constexpr double kRadius = 0.25, kDt = 1.0 / 60;

BodyDefinition Tile(const Vector3& top) {
  return {.shape = Shape::Box({0.5, 0.5, 0.25}),
          .kind = BodyKind::kFixed,
          .position_W = top - Vector3(0, 0, 0.25),
          .friction = 0,
          .restitution = 0};
}

// Body 0 is fixed, body 1 the ball. The contact they have, and what it becomes.
struct Meeting {
  World world{Settings{}};
  Contact before, after;
  bool passes = false;

  Meeting(const BodyDefinition& fixed, const Vector3& ball, const Vector3& velocity, double radius = kRadius) {
    world.Add(fixed);
    world.Add(Ball(ball, radius));
    const Body &a = world.body(0), &b = world.body(1);
    std::vector<Contact> found;
    CollideShapes(world.shape(0), {a.position_W, a.rotation_WB.toRotationMatrix()}, world.shape(1),
                  {b.position_W, b.rotation_WB.toRotationMatrix()}, 10, &found);
    before = after = found.at(0);
    passes = PassesBy({a, world.shape(0), Vector3::Zero(), Vector3::Zero()},
                      {b, world.shape(1), kDt * velocity, Vector3::Zero()}, {}, &after);
  }
};

TEST(PassesBy, BallRollsOverTheEdgeOfALevelTile) {
  const Meeting m(Tile({0, 0, 0}), {-0.51, 0, kRadius}, {3, 0, 0});
  ASSERT_TRUE(m.passes);
  EXPECT_LT(m.before.normal_W.x(), -0.03);  // the plane at the edge stands in its way
  EXPECT_NEAR((m.after.normal_W - Vector3::UnitZ()).norm(), 0, 1e-12);
  EXPECT_NEAR(m.after.gap, 0, 1e-12);
  EXPECT_NEAR((m.after.point_W - Vector3(-0.51, 0, 0)).norm(), 0, 1e-12);  // below the ball, where it is now
}

// Slow, it is far from the edge for many steps: in one of them the normal hardly turns.
TEST(PassesBy, SlowBallToo) {
  const Meeting m(Tile({0, 0, 0}), {-0.51, 0, kRadius}, {0.01, 0, 0});
  ASSERT_TRUE(m.passes);
  const Vector3 travel = kDt * Vector3(0.01, 0, 0);
  const double x = 0.01 - travel.x(), end = std::hypot(kRadius, x) - kRadius;
  EXPECT_NEAR(m.after.gap + m.after.normal_W.dot(travel), end, 1e-12);
}

TEST(PassesBy, NotATileThatStandsHigher) {
  EXPECT_FALSE(Meeting(Tile({0, 0, 0.001}), {-0.51, 0, kRadius}, {3, 0, 0}).passes);
}

TEST(PassesBy, NotAFallOnATileNorOnItsEdge) {
  EXPECT_FALSE(Meeting(Tile({0, 0, 0}), {0, 0, kRadius}, {0, 0, -1}).passes);
  EXPECT_FALSE(Meeting(Tile({0, 0, 0}), {0, 0, kRadius}, {5, 0, -1}).passes);
  EXPECT_FALSE(Meeting(Tile({0, 0, 0}), {-0.55, 0, kRadius}, {0, 0, -1}).passes);
}

TEST(PassesBy, BallBesideABall) {
  const BodyDefinition post = {.shape = Shape::Sphere(kRadius), .kind = BodyKind::kFixed};
  EXPECT_TRUE(Meeting(post, {-0.03, 2 * kRadius, 0}, {3, 0, 0}).passes);
  EXPECT_FALSE(Meeting(post, {-0.03, 2 * kRadius - 0.001, 0}, {3, 0, 0}).passes);  // scratches it
  EXPECT_FALSE(Meeting(post, {-2 * kRadius - 0.01, 0, 0}, {3, 0, 0}).passes);      // head on
}

// The moment of the least gap is in the midst of the step.
TEST(PassesBy, BallsAreJudgedByTheirLeastGap) {
  const BodyDefinition post = {.shape = Shape::Sphere(kRadius), .kind = BodyKind::kFixed};
  for (const double share : {0.1, 0.37, 0.9}) {
    const double before = -share * 3 * kDt;  // [m] along its way
    EXPECT_TRUE(Meeting(post, {before, 2 * kRadius + 1e-8, 0}, {3, 0, 0}).passes) << share;
    EXPECT_FALSE(Meeting(post, {before, 2 * kRadius - 1e-6, 0}, {3, 0, 0}).passes) << share;
  }
}

// Flies past the corner within the step and is free at its end: the way counts.
TEST(PassesBy, NotThroughACorner) {
  EXPECT_FALSE(Meeting(Tile({0, 0, 0}), {-0.52, 0.48, -0.01}, {5, 5, 0}, 0.02).passes);
}

double SpeedAfterStep(double step) {
  Settings settings;
  settings.threads = 1;
  World world(settings);
  world.Add(Tile({0, 0, 0}));
  world.Add(Tile({1, 0, step}));
  const int ball = world.Add(Ball({0, 0, kRadius}, kRadius, 0));
  world.SetVelocity(ball, {2, 0, 0}, Vector3::Zero());
  double fastest_up = 0;
  for (int i = 0; i < 30; ++i) {
    testing::Step(&world, kDt);
    fastest_up = std::max(fastest_up, world.body(ball).linear_velocity_W.z());
  }
  EXPECT_GT(world.body(ball).position_W.z(), kRadius + step - 1e-3);
  return world.body(ball).linear_velocity_W.x();
}

TEST(World, BallKeepsItsSpeedOverASeamButNotOverAStep) {
  EXPECT_NEAR(SpeedAfterStep(0), 2, 1e-9);
  // At the edge of a step of s the normal leans by acos(1 - s / r); the ball goes on along the edge's plane.
  EXPECT_LT(SpeedAfterStep(0.02), 2 * (1 - 0.02 / kRadius));
}

// Frictionless and elastic: the normal part of the velocity at the place of impact passes to the other ball, however
// obliquely they meet.
TEST(World, ObliqueHitOfTwoBallsIsNoGraze) {
  for (const double offset : {0.3, 0.45, 0.49}) {
    Settings settings;
    settings.threads = 1;
    settings.gravity.setZero();
    World world(settings);
    const int target = world.Add(Ball({0, 0, 0}, kRadius, 0, 1));
    const int ball = world.Add(Ball({-1, offset, 0}, kRadius, 0, 1));
    world.SetVelocity(ball, {0.5, 0, 0}, Vector3::Zero());
    for (int i = 0; i < 1000; ++i) testing::Step(&world, 1.0 / 240);
    const Vector3 v = world.body(target).linear_velocity_W;
    const double sine = offset / (2 * kRadius), cosine = std::sqrt(1 - sine * sine);
    EXPECT_NEAR(v.norm(), 0.5 * cosine, 0.02) << offset;
    EXPECT_NEAR((v + world.body(ball).linear_velocity_W - Vector3(0.5, 0, 0)).norm(), 0, 1e-12);
  }
}

// What grazes gets no push besides its contact normal: without friction nothing may spin, and over ten frames energy falls.
TEST(World, FrictionlessBallsNeverSpinNorGainEnergy) {
  Settings settings;
  settings.threads = 1;
  World world(settings);
  world.Add(Floor(0));
  for (const auto& [place, normal] : {std::pair{Vector3(-1.2, 0, 0), Vector3(1, 0, 0)},
                                      {Vector3(1.2, 0, 0), Vector3(-1, 0, 0)},
                                      {Vector3(0, -1.2, 0), Vector3(0, 1, 0)},
                                      {Vector3(0, 1.2, 0), Vector3(0, -1, 0)}})
    world.Add({.shape = Shape::HalfSpace(),
               .kind = BodyKind::kFixed,
               .position_W = place,
               .rotation_WB = Quaternion::FromTwoVectors(Vector3::UnitZ(), normal),
               .friction = 0,
               .restitution = 0});
  for (int i = 0; i < 20; ++i)
    world.Add(
        Ball({0.6 * (i % 2 ? 1 : -1) + 0.004 * i, 0.6 * (i / 2 % 2 ? 1 : -1) - 0.005 * i, 1 + 1.1 * (i / 4)}, 0.5, 0));
  std::vector<double> energies{testing::Energy(world.bodies())};
  double spin = 0;
  for (int i = 0; i < 240; ++i) {
    testing::Step(&world, 1.0 / 30);
    energies.push_back(testing::Energy(world.bodies()));
    for (const Body& b : world.bodies()) spin = std::max(spin, b.angular_velocity_W.norm());
  }
  EXPECT_LT(spin, 1e-9);
  for (size_t k = 10; k < energies.size(); ++k) EXPECT_LT(energies[k] - energies[k - 10], 1e-2) << k;
}

}  // namespace
}  // namespace islet
