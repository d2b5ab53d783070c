#include "engine/freezing/stop_impulses.h"

#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using Momentum = StopImpulses::Momentum;

// A unit cube on the floor (body 0), held at some of its corners.
struct HeldCube {
  std::vector<Body> bodies;
  std::vector<Contact> contacts;
  std::vector<Matrix3> frames;
  SuiteFrame frame;
  std::vector<int> all;

  explicit HeldCube(const std::vector<Vector3>& corners) : bodies(2) {
    bodies[0].kind = BodyKind::kFixed;
    bodies[1].radius = std::sqrt(0.75);
    bodies[1].position_W = {0, 0, 0.5};
    for (const Vector3& corner : corners) {
      Contact contact;
      contact.body_a = 0, contact.body_b = 1;
      contact.point_W = corner;
      contact.normal_W = Vector3::UnitZ();
      contact.friction = 0.5;
      all.push_back(static_cast<int>(contacts.size()));
      contacts.push_back(contact);
      frames.push_back(ContactFrame(contact.normal_W));
      frame.holding.push_back({1, 0, 0});
    }
    frame.bodies = bodies;
    frame.frames = frames;
    frame.contacts = {contacts, frames};
  }
  Momentum GivenBy(const std::vector<Vector3>& impulses) const {
    Momentum sum = Momentum::Zero();
    for (size_t c = 0; c < contacts.size(); ++c) {
      const Vector3 j = frames[c] * impulses[c];
      sum.head<3>() += j;
      sum.tail<3>() += (contacts[c].point_W - bodies[1].position_W).cross(j) / bodies[1].radius;
    }
    return sum;
  }
};

TEST(StopImpulses, FourCornersGiveAnyMomentum) {
  const HeldCube cube({{0.5, 0.5, 0}, {0.5, -0.5, 0}, {-0.5, 0.5, 0}, {-0.5, -0.5, 0}});
  StopImpulses stop;
  stop.Prepare(cube.frame, std::vector<int>{1}, cube.all);
  Momentum wanted;
  wanted << 1e-6, -2e-6, 3e-6, 1e-7, 2e-7, -3e-7;
  std::vector<Vector3> impulses;
  EXPECT_TRUE(stop.Find(std::vector<Momentum>{wanted}, std::vector<double>{1e-15}, 1e-5, StopImpulses::Reach::kNear,
                        &impulses));
  EXPECT_LE((cube.GivenBy(impulses) - wanted).norm(), 1e-15);
}

// Nothing turns it about the line through both.
TEST(StopImpulses, TwoCornersLackTheTurnAboutTheirLine) {
  const HeldCube cube({{0.5, 0, 0}, {-0.5, 0, 0}});
  StopImpulses stop;
  stop.Prepare(cube.frame, std::vector<int>{1}, cube.all);
  Momentum up = Momentum::Zero(), turn = Momentum::Zero();
  up[2] = 1e-6;
  turn[3] = 1e-6;
  std::vector<Vector3> impulses;
  EXPECT_TRUE(
      stop.Find(std::vector<Momentum>{up}, std::vector<double>{1e-15}, 1e-5, StopImpulses::Reach::kNear, &impulses));
  EXPECT_FALSE(stop.Find(std::vector<Momentum>{up + turn}, std::vector<double>{1e-15}, 1e-5, StopImpulses::Reach::kNear,
                         &impulses));
  EXPECT_GT(stop.missed()[0], 1e8);
  EXPECT_EQ(cube.GivenBy(impulses), Momentum(Momentum::Zero()));
}

TEST(StopImpulses, WhatDoesNotPressGivesNothing) {
  HeldCube cube({{0.5, 0.5, 0}, {-0.5, -0.5, 0}, {0.5, -0.5, 0}});
  cube.frame.holding[1].setZero();
  StopImpulses stop;
  stop.Prepare(cube.frame, std::vector<int>{1}, cube.all);
  std::vector<Vector3> impulses;
  stop.Find(std::vector<Momentum>{Momentum::Constant(1e-6)}, std::vector<double>{1e-15}, 1e-5,
            StopImpulses::Reach::kNear, &impulses);
  EXPECT_EQ(impulses[1], Vector3(0, 0, 0));
}

// The load moves near to a corner. The least change would pull at the one across: others press with all four.
TEST(StopImpulses, LoadNearACornerIsPressedByAllFour) {
  const HeldCube cube({{0.5, 0.5, 0}, {0.5, -0.5, 0}, {-0.5, 0.5, 0}, {-0.5, -0.5, 0}});
  StopImpulses stop;
  stop.Prepare(cube.frame, std::vector<int>{1}, cube.all);
  std::vector<Vector3> wanted, impulses;
  for (const double x : {0.9, 0.1})
    for (const double y : {0.9, 0.1}) wanted.push_back({4 * x * y - 1, 0, 0});
  EXPECT_TRUE(stop.Find(std::vector<Momentum>{cube.GivenBy(wanted)}, std::vector<double>{1e-12}, 1e-5,
                        StopImpulses::Reach::kFar, &impulses));
  EXPECT_LE((cube.GivenBy(impulses) - cube.GivenBy(wanted)).norm(), 1e-12);
  for (const Vector3& j : impulses) EXPECT_LE(j.tail<2>().norm(), 0.5 * (1 + j[0]) + 1e-5);
  for (Vector3& j : wanted) j[0] *= 1.3;  // beyond the corner
  EXPECT_FALSE(stop.Find(std::vector<Momentum>{cube.GivenBy(wanted)}, std::vector<double>{1e-12}, 1e-5,
                         StopImpulses::Reach::kFar, &impulses));
  for (const Vector3& j : impulses) EXPECT_LE(j.tail<2>().norm(), 0.5 * (1 + j[0]) + 1e-5);
}

// One of four corners is about to slide along x: a push that way is held by the others.
TEST(StopImpulses, WhatSlidesStaysOnItsCone) {
  HeldCube cube({{0.5, 0.5, 0}, {0.5, -0.5, 0}, {-0.5, 0.5, 0}, {-0.5, -0.5, 0}});
  for (size_t c = 0; c < 4; ++c) cube.frame.holding[c] = cube.frames[c].transpose() * Vector3(c == 0 ? 0.5 : 0, 0, 1);
  StopImpulses stop;
  stop.Prepare(cube.frame, std::vector<int>{1}, cube.all);
  Momentum wanted = Momentum::Zero();
  wanted[0] = 1e-3;
  std::vector<Vector3> impulses;
  EXPECT_TRUE(stop.Find(std::vector<Momentum>{wanted}, std::vector<double>{1e-15}, 1e-5, StopImpulses::Reach::kNear,
                        &impulses));
  EXPECT_LE((cube.GivenBy(impulses) - wanted).norm(), 1e-14);
  const Vector3 after = cube.frame.holding[0] + impulses[0];
  EXPECT_LE(after.tail<2>().norm(), 0.5 * after[0] * (1 + 1e-6));
}

// What nothing touches gets nothing, and does no harm to the others.
TEST(StopImpulses, WhatNothingTouchesIsMissed) {
  HeldCube cube({{0.5, 0.5, 0}, {0.5, -0.5, 0}, {-0.5, 0.5, 0}, {-0.5, -0.5, 0}});
  cube.bodies.resize(3, cube.bodies[1]);
  cube.frame.bodies = cube.bodies;
  StopImpulses stop;
  const Momentum push = Momentum::Constant(1e-6);
  const std::vector<double> limits(2, 1e-15);
  std::vector<Vector3> impulses;
  stop.Prepare(cube.frame, std::vector<int>{1, 2}, cube.all);
  EXPECT_FALSE(stop.Find(std::vector<Momentum>{push, push}, limits, 1e-5, StopImpulses::Reach::kNear, &impulses));
  EXPECT_LE(stop.missed()[0], 1);
  EXPECT_NEAR(stop.missed()[1], push.norm() / 1e-15, 1);
  stop.Prepare(cube.frame, std::vector<int>{1, 2}, std::vector<int>{});
  EXPECT_FALSE(stop.Find(std::vector<Momentum>{push, push}, limits, 1e-5, StopImpulses::Reach::kNear, &impulses));
  EXPECT_TRUE(impulses.empty());
}

// A crowd's pile comes to rest by impulses alone: the ledger finds all of its momentum in the step in which it freezes, too.
TEST(StopImpulses, FreezingTakesNoMomentum) {
  Settings settings;
  settings.threads = 1;
  settings.tolerance = 1e-3;  // leaves velocities that show
  World world(testing::AsCrowd(settings));
  world.Add(testing::Floor());
  for (int layer = 5; layer > 0; --layer)
    for (int i = 0; i < layer * layer; ++i)
      world.Add(testing::Cube(
          {1.3 * (i % layer - 0.5 * (layer - 1)), 1.2 * (i / layer - 0.5 * (layer - 1)), 1.1 * (5 - layer) + 0.55}));
  int frozen = 0;
  for (int frame = 0; frame < 300 && frozen < 55; ++frame) {
    const StepReport report = world.Step(1.0 / 60);
    EXPECT_LE(report.ledger.momentum_unexplained.value, 1e-9) << frame;
    EXPECT_LE(report.ledger.angular_momentum_unexplained.value, 1e-9) << frame;
    frozen = report.frozen;
  }
  EXPECT_EQ(frozen, 55);
}

}  // namespace
}  // namespace islet
