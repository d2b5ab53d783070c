// Steps of small groups that once took too much work: a group that needs more than its share goes with the crowd, which is less exact.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "scenes/random.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::Floor;

// A box lies on one edge, which overlaps by a little less than what touches, and its other edge is about to land. What is still on its way
// makes no blow of what lies: there were eighteen in a step, one for each hair by which the edge got deeper.
TEST(Work, WhatIsOnItsWayMakesNoBlowOfWhatTouches) {
  constexpr double kOverlap = 1.36e-6, kGap = 7e-5, kApproach = 0.0133;
  const Vector3 half(0.3, 0.2, 0.2);
  for (const double roll : {1e-6, 5e-6, -2e-5, 1e-4}) {
    World world(Awake());
    world.Add(Floor(0, 0));
    const double tilt = 0.5 * kGap / half.x();
    BodyDefinition box{.shape = Shape::Box(half), .mass = 1, .friction = 0, .restitution = 0};
    box.position_W.z() = half.z() * std::cos(tilt) + half.x() * std::sin(tilt) - kOverlap;
    box.rotation_WB = testing::Turn(tilt, Vector3::UnitY());
    box.angular_velocity_W = {roll, -0.5 * kApproach / half.x(), 0};
    box.linear_velocity_W = -box.angular_velocity_W.cross(Vector3(half.x(), 0, -half.z()));
    world.Add(box);
    const StepReport report = testing::Step(&world, 1.0 / 60);
    EXPECT_GT(report.pieces, 0) << roll;
    EXPECT_LE(report.pieces, 3) << roll;
    EXPECT_LT(world.body(1).angular_velocity_W.norm(), 1e-8) << roll;
  }
}

// Cans that rock and roll on their rims until they lie. Each blow leaves an overlap of some 1e-6 of a size. When they added up to what a
// step may leave, no piece was short enough to leave none: of a hundred steps one went with the crowd.
TEST(Work, CansThatRockNeedNoMore) {
  SplitMix64 random(11);
  int steps = 0, given_up = 0;
  for (int k = 0; k < 60; ++k) {
    const double friction = 0.3 * (k % 3), restitution = k % 2 == 0 ? 0 : 0.3;
    const double dt = k % 4 < 2 ? 1.0 / 60 : 1.0 / 240;
    World world(Awake());
    world.Add(Floor(friction, restitution));
    const double radius = random.Uniform(0.05, 0.2), half = random.Uniform(0.5, 1.2) * radius,
                 tilt = random.Uniform(0.02, 0.4);
    BodyDefinition can{
        .shape = Shape::Cylinder(radius, half), .mass = 1, .friction = friction, .restitution = restitution};
    can.position_W.z() = half * std::cos(tilt) + radius * std::sin(tilt);
    can.rotation_WB = testing::Turn(tilt, Vector3::UnitY());
    can.angular_velocity_W = random.Uniform(0, 6) * random.Direction();
    can.linear_velocity_W = {random.Uniform(-1, 1), random.Uniform(-1, 1), 0};
    world.Add(can);
    for (int i = 0; i < 1.2 / dt; ++i, ++steps) given_up += testing::Step(&world, dt).pieces == 0;
  }
  EXPECT_LE(given_up, steps / 500);
}

// Twelve boxes fall on each other, each faster than the one below. They need more work than a step has, and the report says so where all go with a
// crowd, which knows no pieces.
TEST(Work, WhoGivesUpIsTold) {
  SplitMix64 random(3);
  World world(Awake());
  world.Add(Floor(0.5, 0.3));
  for (int i = 0; i < 12; ++i)
    world.Add({.shape = Shape::Box({0.08, 0.06, 0.05}),
               .mass = 1,
               .position_W = {0.05 * (i % 2), 0.05 * (i / 2 % 2), 0.3 + 0.4 * i},
               .rotation_WB = testing::Turn(random.Uniform(0, 3), random.Direction()),
               .linear_velocity_W = {0, 0, -3 - 2.0 * i},
               .restitution = 0.3});
  int most = 0;
  for (int frame = 0; frame < 30; ++frame) {
    const StepReport report = testing::Step(&world, 1.0 / 60);
    EXPECT_TRUE(report.pieces > 0 || report.gave_up == 12) << frame;
    most = std::max(most, report.gave_up);
  }
  EXPECT_EQ(most, 12);
}

// A plank lies on two boxes, one of them without friction, on a plate that speeds up. When what rode had to catch up within a piece, they needed
// more work than a step has in each.
TEST(Work, PlankOnAPlateThatSpeedsUpNeedsNoMore) {
  constexpr double kStep = 1.0 / 30, kAcceleration = 4.4;
  World world(Awake());
  world.Add({.shape = Shape::Box({4, 4, 0.01}), .kind = BodyKind::kKinematic, .position_W = {0, 0, -0.01}});
  BodyDefinition box{
      .shape = Shape::Box({0.03, 0.03, 0.02}), .mass = 0.2, .position_W = {0.3, 0.3, 0.02}, .restitution = 0};
  world.Add(box);
  box.position_W.y() = 0.5;
  box.friction = 0;
  world.Add(box);
  world.Add({.shape = Shape::Box({0.03, 0.15, 0.01}), .mass = 0.3, .position_W = {0.3, 0.4, 0.05}, .restitution = 0});
  for (int frame = -6; frame < 15; ++frame) {
    world.SetVelocity(0, {std::max(0.0, kAcceleration * (frame + 0.5) * kStep), 0, 0}, Vector3::Zero());
    EXPECT_EQ(testing::Step(&world, kStep).gave_up, 0) << frame;
  }
}

// Slabs that slide and spin over the edge of a table, and lie on it where one of their edges crosses its. They press along what is square to
// both, not along the table's normal: by that they gained energy at any length of the piece.
TEST(Work, SlabsSpinOverAnEdge) {
  SplitMix64 random(2);
  for (int k = 0; k < 200; ++k) {
    World world(Awake());
    world.Add({.shape = Shape::Box({0.5, 0.5, 0.5}), .kind = BodyKind::kFixed, .position_W = {0, 0, -0.5}});
    const Vector3 half(0.3, 0.2, 0.02);
    const double about = random.Uniform(0, 2 * std::numbers::pi), ahead = random.Uniform(0, 2 * std::numbers::pi);
    BodyDefinition slab{.shape = Shape::Box(half), .mass = 1, .friction = 0, .restitution = 0};
    slab.rotation_WB = testing::Turn(std::pow(10, random.Uniform(-4.5, -3)), {std::cos(about), std::sin(about), 0}) *
                       testing::Turn(random.Uniform(0, std::numbers::pi), Vector3::UnitZ());
    slab.position_W = {0.5 - random.Uniform(0, 0.12), random.Uniform(-0.2, 0.2), 0};
    slab.linear_velocity_W = random.Uniform(0.2, 1.5) * Vector3(std::cos(ahead), std::sin(ahead), 0);
    slab.angular_velocity_W = {0, 0, random.Uniform(-4, 4)};
    // As low as what is over the table lets it: height of its lower side where its edges, of which those along y are straight, cross the table's.
    double rises = -INFINITY;
    const Matrix3 turn = slab.rotation_WB.toRotationMatrix();
    for (int side = 0; side < 4; ++side) {
      const auto corner = [&](int i) -> Vector3 {
        const double x = i % 4 == 0 || i % 4 == 3 ? 1 : -1, y = i % 4 < 2 ? 1 : -1;
        return slab.position_W + turn * Vector3(x * half.x(), y * half.y(), -half.z());
      };
      const Vector3 from = corner(side), to = corner(side + 1);
      if (from.x() <= 0.5) rises = std::max(rises, -from.z());
      if ((from.x() <= 0.5) != (to.x() <= 0.5))
        rises = std::max(rises, -(from + (0.5 - from.x()) / (to.x() - from.x()) * (to - from)).z());
    }
    slab.position_W.z() += rises;
    world.Add(slab);
    EXPECT_GT(testing::Step(&world, 1.0 / 60).pieces, 0) << k << " went with the crowd";
  }
}

}  // namespace
}  // namespace islet
