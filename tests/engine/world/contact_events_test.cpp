// What begins, persists, ends, hits, and what sensors tell.
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::AsCrowd;
using testing::Awake;
using testing::Cube;
using testing::Floor;
using testing::kGravity;

constexpr double kDt = 1.0 / 60;
using Kind = ContactEventKind;

std::vector<Kind> KindsOf(const World& world, int a, int b) {
  std::vector<Kind> kinds;
  for (const ContactEvent& e : world.events())
    if (e.body_a == a && e.body_b == b) kinds.push_back(e.kind);
  return kinds;
}

TEST(ContactEvents, ABodyLandsStaysAndGoes) {
  for (const bool crowd : {false, true}) {
    Settings settings;
    settings.threads = 1;
    World world(crowd ? AsCrowd(settings) : settings);
    world.Add(Floor());
    const int cube = world.Add(Cube({0, 0, 0.6}));
    int begins = 0, persists = 0;
    for (int i = 0; i < 60; ++i) {
      testing::Step(&world, kDt);
      const std::vector<Kind> kinds = KindsOf(world, 0, cube);
      ASSERT_LE(kinds.size(), 1u);
      if (kinds.empty()) {
        EXPECT_EQ(begins, 0) << "it has landed for good";
        continue;
      }
      begins += kinds[0] == Kind::kBegin;
      persists += kinds[0] == Kind::kPersist;
    }
    EXPECT_EQ(begins, 1);
    EXPECT_GT(persists, 40);
    world.Remove(cube);
    testing::Step(&world, kDt);
    EXPECT_EQ(KindsOf(world, 0, cube), std::vector{Kind::kEnd});
    testing::Step(&world, kDt);
    EXPECT_TRUE(world.events().empty());
  }
}

// Boxes of a wall touch those diagonal to them by edges, which press nothing and are no contacts: nor are they when everything is looked at anew.
TEST(ContactEvents, NothingBeginsWhereNothingHappens) {
  World world(AsCrowd(Settings{}));
  world.Add(Floor());
  for (int i = 0; i < 16; ++i) world.Add(Cube({1.0 * (i % 4), 0, 0.5 + i / 4}));
  const int apart = world.Add(Cube({50, 0, 0.5}));
  for (int k = 0; k < 30; ++k) world.Step(kDt);
  ASSERT_TRUE(world.body(1).frozen);
  for (int k = 0; k < 3; ++k) {
    world.SetVelocity(apart, Vector3::Zero(), Vector3::Zero());
    world.Step(kDt);
    for (const ContactEvent& event : world.events())
      EXPECT_EQ(event.kind, Kind::kPersist) << event.body_a << " " << event.body_b;
  }
}

// A ball that bounces is away again at the end of the step: only its blow tells.
TEST(ContactEvents, ABounceIsAHit) {
  for (const bool crowd : {false, true}) {
    World world(crowd ? AsCrowd(Awake()) : Awake());
    world.Add(Floor(0.5, 1));
    const int ball = world.Add({.shape = Shape::Sphere(0.5), .mass = 2, .position_W = {0, 0, 1.5}, .restitution = 1});
    double impulse = 0, approach = 0;
    int hits = 0;
    for (int i = 0; i < 60; ++i) {
      testing::Step(&world, kDt);
      for (const HitEvent& hit : world.hits()) {
        EXPECT_EQ(hit.body_a, 0);
        EXPECT_EQ(hit.body_b, ball);
        EXPECT_NEAR(hit.point_W.x(), 0, 1e-12);
        impulse = hit.impulse_W.z();
        approach = hit.approach;
        ++hits;
      }
    }
    EXPECT_EQ(hits, 1);
    const double exact = 2 * 2 * std::sqrt(2 * kGravity);
    EXPECT_NEAR(impulse, exact, (crowd ? 0.05 : 1e-3) * exact);
    EXPECT_NEAR(approach, std::sqrt(2 * kGravity), kGravity * kDt);
  }
}

TEST(ContactEvents, WhatRestsHitsNobody) {
  for (const bool crowd : {false, true}) {
    World world(crowd ? AsCrowd(Awake()) : Awake());
    world.Add(Floor());
    for (int i = 0; i < 3; ++i) world.Add(Cube({0, 0, 0.5 + i}));
    for (int i = 0; i < 30; ++i) {
      testing::Step(&world, kDt);
      EXPECT_TRUE(world.hits().empty()) << i;
      EXPECT_EQ(world.events().size(), 3u);
    }
  }
}

// However fast, what goes through a sensor begins and ends there once, forwards and backwards, whichever of the two moves.
TEST(ContactEvents, NothingPassesASensorUnseen) {
  for (const double speed : {5.0, 30.0, 70.0, 300.0, -300.0})
    for (const bool sensor_moves : {false, true}) {
      World world;
      world.SetGravity({0, 0, 0});
      const Vector3 v(0, 0, -speed);
      world.Add({.shape = Shape::Box({1, 1, 0.01}),
                 .kind = BodyKind::kKinematic,
                 .linear_velocity_W = sensor_moves ? Vector3(-v) : Vector3(Vector3::Zero()),
                 .sensor = true});
      for (const double x : {0.0, 3.0})  // the second one misses it
        world.Add({.shape = Shape::Sphere(0.05),
                   .position_W = {x, 0, speed > 0 ? 1.07 : -1.07},
                   .linear_velocity_W = sensor_moves ? Vector3(Vector3::Zero()) : v});
      int begins = 0, ends = 0;
      for (int i = 0; i < 60; ++i) {
        world.Step(0.01);
        for (const ContactEvent& e : world.events()) {
          EXPECT_TRUE(e.sensor && e.body_b == 1);
          begins += e.kind == ContactEventKind::kBegin;
          ends += e.kind == ContactEventKind::kEnd;
        }
      }
      EXPECT_EQ(begins, 1) << speed << sensor_moves;
      EXPECT_EQ(ends, 1) << speed << sensor_moves;
    }
}

TEST(ContactEvents, ASensorTellsAndIsNotFelt) {
  for (const bool crowd : {false, true}) {
    World world(crowd ? AsCrowd(Awake()) : Awake());
    world.Add(Floor());
    const int gate = world.Add(
        {.shape = Shape::Box({1, 1, 0.25}), .kind = BodyKind::kFixed, .position_W = {0, 0, 3}, .sensor = true});
    const int ball = world.Add({.shape = Shape::Sphere(0.1), .position_W = {0, 0, 5}, .restitution = 0});
    double begin = 0, end = 0;
    for (int i = 0; i < 90; ++i) {
      testing::Step(&world, kDt);
      for (const ContactEvent& e : world.events()) {
        if (!e.sensor) continue;
        EXPECT_EQ(e.body_a, gate);
        EXPECT_EQ(e.body_b, ball);
        if (e.kind == Kind::kBegin) begin = world.time();
        if (e.kind == Kind::kEnd) end = world.time();
      }
    }
    const auto falls = [](double height) { return std::sqrt(2 * height / kGravity); };
    EXPECT_NEAR(begin, falls(5 - 3.35), kDt);
    EXPECT_NEAR(end, falls(5 - 2.65), kDt);
    EXPECT_NEAR(world.body(ball).position_W.z(), 0.1, 1e-3);
  }
}

// A world that rests repeats itself, and so do its events.
TEST(ContactEvents, FrozenBodiesPersist) {
  Settings settings;
  settings.threads = 1;
  World world(settings);
  world.Add(Floor());
  world.Add(Cube({0, 0, 0.5}));
  for (int i = 0; i < 60; ++i) testing::Step(&world, kDt);
  ASSERT_TRUE(world.body(1).frozen);
  EXPECT_EQ(KindsOf(world, 0, 1), std::vector{Kind::kPersist});
}

// A smooth ball that spins and flies past along a wall hits it as one that does neither.
TEST(ContactEvents, ASpinIsNoApproach) {
  for (const bool crowd : {false, true})
    for (const double along : {-7.0, -3.0, 0.0, 7.0})
      for (const double spin : {-5.0, 0.0, 5.0}) {
        Settings settings = crowd ? AsCrowd(Awake()) : Awake();
        settings.gravity.setZero();
        World world(settings);
        world.Add(Floor(0, 1));
        const int ball = world.Add({.shape = Shape::Sphere(0.5),
                                    .mass = 1,
                                    .position_W = {0, 0, 0.52},
                                    .linear_velocity_W = {along, 0, -1},
                                    .angular_velocity_W = {0, spin, 0},
                                    .friction = 0,
                                    .restitution = 1});
        testing::Step(&world, 0.05);
        ASSERT_EQ(world.hits().size(), 1u) << crowd << ", " << along << ", " << spin;
        EXPECT_NEAR(world.hits()[0].approach, 1, 1e-9) << crowd << ", " << along << ", " << spin;
        EXPECT_NEAR(world.hits()[0].impulse_W.z(), 2, 1e-6);
        EXPECT_LT((world.hits()[0].impulse_W - world.ImpulseOn(ball)).norm(), 1e-12);
      }
}

// A tumbling box lands on one corner, then another: the hit tells of all.
TEST(ContactEvents, AHitHasAllPointsOfItsPair) {
  for (const bool crowd : {false, true}) {
    Settings settings = crowd ? AsCrowd(Awake()) : Awake();
    settings.gravity.setZero();
    World world(settings);
    world.Add(Floor());
    BodyDefinition box = Cube({0, 0, 0.6});
    box.rotation_WB = testing::Turn(0.05, Vector3(1, 2, 0));
    box.linear_velocity_W = {0.3, 0, -2};
    box.angular_velocity_W = {1, -2, 0.5};
    const int number = world.Add(box);
    for (int i = 0; i < 20; ++i) {
      testing::Step(&world, 0.02);
      for (const HitEvent& hit : world.hits()) EXPECT_LT((hit.impulse_W - world.ImpulseOn(number)).norm(), 1e-12) << i;
    }
  }
}

TEST(ContactEvents, AHalfSpaceSenses) {
  World world(Awake());
  const int pit =
      world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed, .position_W = {0, 0, -2}, .sensor = true});
  const int ball = world.Add({.shape = Shape::Sphere(0.5)});
  int begins = 0;
  for (int i = 0; i < 60; ++i) {
    testing::Step(&world, kDt);
    for (const ContactEvent& e : world.events()) {
      begins += e.kind == Kind::kBegin;
      EXPECT_EQ(e.body_a, pit);
      EXPECT_EQ(e.body_b, ball);
    }
  }
  EXPECT_EQ(begins, 1);
}

// What turns through a sensor is told as well, whichever of the two turns, also by more than half a circle.
TEST(ContactEvents, NothingTurnsThroughASensorUnseen) {
  for (const double turn : {1.0, 4.0})
    for (const bool sensor_turns : {false, true}) {
      World world;
      world.SetGravity({0, 0, 0});
      const auto add = [&](const Shape& shape, const Vector3& at, double spin, bool sensor) {
        world.Add({.shape = shape,
                   .kind = BodyKind::kKinematic,
                   .position_W = at,
                   .angular_velocity_W = {0, 0, spin},
                   .sensor = sensor});
      };
      add(Shape::Box({2, 0.05, 0.05}), Vector3::Zero(), turn / 0.01, sensor_turns);
      add(Shape::Sphere(0.05), 1.5 * Vector3(std::cos(0.5 * turn), std::sin(0.5 * turn), 0), 0, !sensor_turns);
      world.Step(0.01);
      ASSERT_EQ(world.events().size(), 1u) << turn << sensor_turns;
      EXPECT_EQ(world.events()[0].kind, ContactEventKind::kBegin);
    }
}

// What flies, too, may turn by more than half a circle in a step.
TEST(ContactEvents, WhatSpinsThroughASensorIsSeen) {
  for (const double turn : {1.0, 4.18, 7.0}) {
    World world(Awake());
    world.SetGravity({0, 0, 0});
    world.Add({.shape = Shape::Capsule(0.02, 0.5),
               .rotation_WB = testing::Turn(0.5 * M_PI, Vector3::UnitY()),
               .angular_velocity_W = {0, 0, 60 * turn}});
    const double seen = std::min(0.54, 0.5 * turn);
    world.Add({.shape = Shape::Sphere(0.02),
               .kind = BodyKind::kFixed,
               .position_W = 0.4 * Vector3(std::cos(seen), std::sin(seen), 0),
               .sensor = true});
    world.Add({.shape = Shape::Sphere(0.02),
               .kind = BodyKind::kFixed,
               .position_W = 0.4 * Vector3(std::cos(-0.5), std::sin(-0.5), 0),
               .sensor = true});
    world.Step(1.0 / 60);
    ASSERT_EQ(world.events().size(), turn > 2 ? 2u : 1u) << turn;
    EXPECT_EQ(world.events()[0].body_b, 1);
  }
}

// A step that is cut into parts tells of it as of one: each pair once, what it gave in all of them, and how it closed as the step began.
TEST(ContactEvents, PartsOfAStepAreOneStep) {
  Settings settings = Awake();
  settings.gravity.setZero();
  settings.group_bodies = 1;
  World world(settings);
  world.Add({.shape = Shape::Sphere(0.1), .mass = 1, .linear_velocity_W = {60, 0, 0}, .restitution = 1});
  for (int k = 0; k < 3; ++k)
    world.Add({.shape = Shape::Sphere(0.1), .mass = 1, .position_W = {0.35 + 0.25 * k, 0, 0}, .restitution = 1});
  const StepReport report = world.Step(1.0 / 60);
  EXPECT_FALSE(report.Failed());
  ASSERT_EQ(world.hits().size(), 3u);
  for (int k = 0; k < 3; ++k) {
    const HitEvent& hit = world.hits()[k];
    EXPECT_EQ(hit.body_a, k);
    EXPECT_EQ(hit.approach, k == 0 ? 60 : 0) << "the others did not close as the step began";
    EXPECT_NEAR(hit.impulse_W.x(), 60, 1e-9);
  }
}

// What rides on a wall that goes in a circle is pressed to it, and hits nothing.
TEST(ContactEvents, WhatRidesInACircleHitsNothing) {
  const double rate = 6, radius = 1.6;
  World world(testing::Awake());
  const int wall = world.Add(
      {.shape = Shape::Box({0.1, 1, 1}), .kind = BodyKind::kKinematic, .position_W = {radius, 0, 0}, .friction = 1});
  world.Add({.shape = Shape::Box({0.25, 0.25, 0.25}),
             .position_W = {radius - 0.35, 0, 0},
             .linear_velocity_W = {0, rate * (radius - 0.35), 0},
             .angular_velocity_W = {0, 0, rate},
             .friction = 1,
             .restitution = 0});
  for (int i = 1; i <= 120; ++i) {
    const double angle = rate * i * kDt;
    world.MoveTo(wall, {radius * std::cos(angle), radius * std::sin(angle), 0}, testing::Turn(angle, Vector3::UnitZ()),
                 kDt);
    testing::Step(&world, kDt);
    if (i > 2) {
      EXPECT_TRUE(world.hits().empty()) << i;
    }
  }
}

}  // namespace
}  // namespace islet
