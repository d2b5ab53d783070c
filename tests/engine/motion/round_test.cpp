// Capsules and cylinders in motion, in scenes whose answer is known; every step's ledger is looked at.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::Floor;
using testing::kGravity;
using testing::StepTimes;
using testing::Turn;

constexpr double kRadius = 0.2;

// On its side along y, its axis `height` above the origin.
BodyDefinition Lying(const Shape& shape, double height, double incline = 0) {
  return {.shape = shape,
          .mass = 2,
          .position_W = Turn(incline, Vector3::UnitY()) * Vector3(0, 0, height),
          .rotation_WB = Turn(M_PI / 2, Vector3::UnitX()),
          .friction = 0.8};
}

std::vector<Shape> Rollers() { return {Shape::Cylinder(kRadius, 0.3), Shape::Capsule(kRadius, 0.3)}; }

TEST(Round, RollsOnAsFastAsItDid) {
  for (const Shape& shape : Rollers()) {
    for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
      for (const bool slab : {false, true}) {
        World world(Awake());
        if (slab) {
          world.Add({.shape = Shape::Box({20, 2, 0.5}),
                     .kind = BodyKind::kFixed,
                     .position_W = {0, 0, -0.5},
                     .friction = 0.8});
        } else {
          world.Add(Floor(0.8));
        }
        BodyDefinition roller = Lying(shape, kRadius);
        roller.linear_velocity_W = {3, 0, 0};
        roller.angular_velocity_W = {0, 3 / kRadius, 0};
        world.Add(roller);
        StepTimes(&world, static_cast<int>(2 / dt), dt);
        EXPECT_NEAR(world.body(1).linear_velocity_W.x(), 3, 1e-8) << dt << slab;
        EXPECT_NEAR(world.body(1).position_W.x(), 6, 1e-6) << dt << slab;
        EXPECT_NEAR(world.body(1).position_W.z(), kRadius, 1e-6);
      }
    }
  }
}

// The axis of a wheel that rolls fast circles its angular momentum, by up to twice as much as the wheel turns. In a whole step of six radians
// contacts pushed it the wrong way round: rounding became a tilt of 1e-4, and wheels and rods rolled off by up to 10 degrees.
TEST(Round, FastWheelsRollStraight) {
  for (const double half_width : {1.0 / 3, 0.5, 1.0, 1.8, 3.0}) {
    for (const double turn : {3.0, 5.0, 12.0, 20.0}) {  // [rad] a step
      World world(Awake());
      world.Add(Floor(1));
      const double r = 0.01, dt = 1.0 / 60, speed = turn * r / dt;
      const int wheel = world.Add({.shape = Shape::Cylinder(r, half_width * r),
                                   .mass = 1e-3,
                                   .position_W = {0, 0, r},
                                   .rotation_WB = Turn(M_PI / 2, Vector3::UnitX()),
                                   .linear_velocity_W = {speed, 0, 0},
                                   .angular_velocity_W = {0, speed / r, 0},
                                   .friction = 1,
                                   .restitution = 0});
      StepTimes(&world, 180, dt);
      EXPECT_NEAR(world.body(wheel).position_W.y(), 0, 3e-6 * speed) << half_width << " " << turn;
      EXPECT_NEAR(world.body(wheel).linear_velocity_W.x(), speed, 1e-9 * speed) << half_width << " " << turn;
    }
  }
}

// A contact goes with the round side that takes it, not halfway between both bodies: rollers on what can move were braked by a part of
// their speed each step, and planks on rollers sank, and grew as fast as that gave.
TEST(Round, RollsAsFreelyOnWhatCanMove) {
  for (const Shape& shape : Rollers()) {
    for (const double dt : {1.0 / 30, 1.0 / 240}) {
      World world(Awake());
      world.Add(Floor(0.8));
      world.Add({.shape = Shape::Box({10, 1, 0.1}), .mass = 1000, .position_W = {0, 0, 0.1}, .friction = 0.8});
      BodyDefinition roller = Lying(shape, 0.2 + kRadius);
      roller.linear_velocity_W = {1, 0, 0};
      roller.angular_velocity_W = {0, 1 / kRadius, 0};
      world.Add(roller);
      StepTimes(&world, static_cast<int>(5 / dt), dt);
      EXPECT_NEAR(world.body(2).linear_velocity_W.x(), 1, 1e-8) << dt;
    }
  }
}

TEST(Round, CarriesAPlankThatCoasts) {
  for (const Shape& shape : Rollers()) {
    for (const int count : {3, 25}) {  // a small group, and a crowd
      for (const double dt : {1.0 / 30, 1.0 / 240}) {
        World world(Awake());
        world.Add(Floor(0.8));
        const double speed = 0.05;
        for (int k = 0; k < count; ++k) {
          BodyDefinition roller = Lying(shape, kRadius);
          roller.position_W.x() = 0.5 * (k - 0.5 * (count - 1));
          roller.linear_velocity_W = {0.5 * speed, 0, 0};
          roller.angular_velocity_W = {0, 0.5 * speed / kRadius, 0};
          world.Add(roller);
        }
        world.Add({.shape = Shape::Box({0.25 * count, 0.5, 0.05}),
                   .mass = 100,
                   .position_W = {0, 0, 2 * kRadius + 0.05},
                   .linear_velocity_W = {speed, 0, 0},
                   .friction = 0.8});
        StepTimes(&world, static_cast<int>(4 / dt), dt);
        EXPECT_NEAR(world.body(count + 1).linear_velocity_W.x(), speed, 1e-9) << count << ' ' << dt;
        EXPECT_NEAR(world.body(count + 1).position_W.z(), 2 * kRadius + 0.05, 1e-9) << count << ' ' << dt;
      }
    }
  }
}

// Along its axis a cylinder is straight: what rolls there takes the contact along wholly. By the radii alone a ball in a groove was braked by
// 3e-3 m/s, and sank in crowds by a tolerance in each step.
TEST(Round, RollsAlongRoundRails) {
  for (const bool crowd : {false, true}) {
    for (const double dt : {1.0 / 30, 1.0 / 240}) {
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      for (const double side : {-0.6, 0.6})
        world.Add({.shape = Shape::Cylinder(0.5, 4),
                   .kind = BodyKind::kFixed,
                   .position_W = {side, 0, 0},
                   .rotation_WB = Turn(M_PI / 2, Vector3::UnitX()),
                   .friction = 0.8});
      const double radius = 0.3, height = std::sqrt(0.8 * 0.8 - 0.6 * 0.6);
      world.Add({.shape = Shape::Sphere(radius),
                 .mass = 1,
                 .position_W = {0, -1, height},
                 .linear_velocity_W = {0, 1, 0},
                 .angular_velocity_W = {-1 / (radius * height / 0.8), 0, 0},
                 .friction = 0.8});
      StepTimes(&world, static_cast<int>(2 / dt), dt);
      EXPECT_NEAR(world.body(2).linear_velocity_W.y(), 1, 1e-9) << crowd << ' ' << dt;
      EXPECT_NEAR(world.body(2).position_W.z(), height, 1e-9) << crowd << ' ' << dt;
    }
  }
}

// What sticks on a table that turns and moves does so as on one that turns, as a crowd, too: nothing of it depends on who looks.
TEST(Round, RidesOnATurntableThatMoves) {
  for (const double speed : {0.0, 1.0}) {
    World world(testing::AsCrowd(Awake()));
    world.Add({.shape = Shape::Cylinder(3, 0.1),
               .kind = BodyKind::kKinematic,
               .position_W = {0, 0, -0.1},
               .linear_velocity_W = {speed, 0, 0},
               .angular_velocity_W = {0, 0, 4},
               .friction = 0.6});
    world.Add({.shape = Shape::Box({0.05, 0.05, 0.05}),
               .mass = 1,
               .position_W = {0.2, 0, 0.05},
               .linear_velocity_W = {speed, 0.8, 0},
               .angular_velocity_W = {0, 0, 4},
               .friction = 0.6});
    StepTimes(&world, 60, 1.0 / 30);
    EXPECT_NEAR(world.body(1).position_W.x() - 2 * speed, 0.2 * std::cos(8), 4e-4) << speed;
    EXPECT_NEAR(world.body(1).position_W.y(), 0.2 * std::sin(8), 4e-4) << speed;  // 9e-3 behind before
  }
}

// What rides on a table that turns takes one piece a step, and stays where it is on it. A piece that gains was halved until it gained no
// more: nine pieces, forty times the time.
TEST(Round, RidesOnATurntableInWholeSteps) {
  for (const Shape& table : {Shape::Cylinder(3, 0.1), Shape::Box({3, 3, 0.1})}) {
    World world(Awake());
    world.Add({.shape = table,
               .kind = BodyKind::kKinematic,
               .position_W = {0, 0, -0.1},
               .angular_velocity_W = {0, 0, 2},
               .friction = 0.6});
    world.Add({.shape = Shape::Box({0.05, 0.05, 0.05}),
               .mass = 1,
               .position_W = {1, 0, 0.05},
               .linear_velocity_W = {0, 2, 0},
               .angular_velocity_W = {0, 0, 2},
               .friction = 0.6});
    for (int step = 0; step < 60; ++step) {
      const StepReport report = world.Step(1.0 / 60);
      EXPECT_FALSE(report.Failed());
      EXPECT_LE(report.pieces, 2) << step;
    }
    // It fell behind by w^3 r dt^2 / 12 a second, 1.9e-4 here, while walls went by under the middle of its chord.
    EXPECT_NEAR(world.body(1).position_W.x(), std::cos(2), 2e-6);
    EXPECT_NEAR(world.body(1).position_W.y(), std::sin(2), 1e-6);
  }
}

// a = g sin(angle) / (1 + I / (m r^2)).
TEST(Round, RollsDownAnIncline) {
  constexpr double kAngle = 0.3, kTime = 1;
  for (const Shape& shape : Rollers()) {
    for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
      World world(Awake());
      world.Add(Floor(0.8, 0, kAngle));
      world.Add(Lying(shape, kRadius, kAngle));
      StepTimes(&world, static_cast<int>(std::round(kTime / dt)), dt);
      const Body& b = world.body(1);
      const double a = kGravity * std::sin(kAngle) / (1 + b.inertia_B(2, 2) / (b.mass * kRadius * kRadius));
      EXPECT_NEAR(b.linear_velocity_W.norm(), a * kTime, 1e-6) << dt;
    }
  }
}

// It falls over where its centre is beyond its rim, whichever way it is turned about its axis.
TEST(Round, StandsAsFarAsItsRimReaches) {
  constexpr double kHalf = 0.4;
  for (const double beyond : {-0.02, 0.02}) {
    for (const double about : {0.0, 0.2, M_PI / 8, 1.0}) {
      const double incline = std::atan(kRadius / kHalf + beyond);
      World world(Awake());
      world.Add(Floor(2, 0, incline));
      world.Add({.shape = Shape::Cylinder(kRadius, kHalf),
                 .mass = 1,
                 .position_W = Turn(incline, Vector3::UnitY()) * Vector3(0, 0, kHalf),
                 .rotation_WB = Turn(incline, Vector3::UnitY()) * Turn(about, Vector3::UnitZ()),
                 .friction = 2});
      StepTimes(&world, 90);
      const double up =
          (world.body(1).rotation_WB * Vector3::UnitZ()).dot(world.body(0).rotation_WB * Vector3::UnitZ());
      if (beyond < 0) {
        EXPECT_NEAR(up, 1, 1e-6) << about;
        EXPECT_LT(world.body(1).linear_velocity_W.norm(), 1e-6) << about;
      } else {
        EXPECT_LT(up, 0.99) << about;
      }
    }
  }
}

TEST(Round, StandsInAStackAndFreezes) {
  Settings settings;
  settings.threads = 1;
  World world(settings);
  world.Add(Floor());
  for (int i = 0; i < 5; ++i)
    world.Add({.shape = Shape::Cylinder(0.3 - 0.04 * i, 0.1),
               .mass = 1,
               .position_W = {0.01 * i, 0, 0.1 + 0.2 * i},
               .friction = 0.5});
  world.Add({.shape = Shape::Box({0.1, 0.1, 0.1}), .mass = 1, .position_W = {0.02, 0, 1.1}, .friction = 0.5});
  StepTimes(&world, 120);
  for (int i = 1; i < 7; ++i) {
    EXPECT_TRUE(world.body(i).frozen) << i;
    EXPECT_LT((world.body(i).position_W.z() - (i < 6 ? 0.1 + 0.2 * (i - 1) : 1.1)), 1e-6) << i;
  }
}

// One coin rolls around on its rim, one spins upright: neither ever gains energy.
TEST(Round, CoinsNeverGainEnergy) {
  for (const double dt : {1.0 / 60, 1.0 / 240}) {
    World world(Awake());
    world.Add(Floor(0.4, 0.2));
    for (const double tilt : {0.3, 1.2}) {
      world.Add({.shape = Shape::Cylinder(0.1, 0.005),
                 .mass = 0.05,
                 .position_W = {tilt, 0, 0.15},
                 .rotation_WB = Turn(tilt, Vector3::UnitX()),
                 .linear_velocity_W = {0, 0.5, 0},
                 .angular_velocity_W = {0, 3, 20},
                 .friction = 0.4,
                 .restitution = 0.2});
    }
    double before = testing::Energy(world.bodies());
    for (double t = 0; t < 6; t += dt) {
      testing::Step(&world, dt);
      const double after = testing::Energy(world.bodies());
      EXPECT_LT(after, before + 1e-9);
      before = after;
    }
  }
}

// The edge is along its axis: it stays so. Where the side had sunk by a hair below the edge only one of its ends was found, and ten steps
// of stairs laid it on its end.
TEST(Round, RollsDownStairsInTheirPlane) {
  for (const double e : {0.0, 0.3, 0.5}) {
    for (const double dt : {1.0 / 60, 1.0 / 240}) {
      World world(Awake());
      for (int k = 0; k < 8; ++k)
        world.Add({.shape = Shape::Box({0.1, 0.5, 0.1}),
                   .kind = BodyKind::kFixed,
                   .position_W = {0.2 * k, 0, -0.1 - 0.1 * k},
                   .friction = 0.5});
      BodyDefinition roller = Lying(Shape::Cylinder(0.12, 0.2), 0.12);
      roller.linear_velocity_W = {1, 0, 0};
      roller.angular_velocity_W = {0, 1 / 0.12, 0};
      roller.friction = 0.5;
      roller.restitution = e;
      world.Add(roller);
      for (double t = 0; t < 1.5; t += dt) {
        EXPECT_FALSE(world.Step(dt).Failed());
        const Body& b = world.body(8);
        EXPECT_LT(std::abs(b.position_W.y()), 1e-6) << e << " " << t;
        EXPECT_LT((b.rotation_WB * Vector3::UnitZ()).cross(Vector3::UnitY()).norm(), 1e-6) << e << " " << t;
      }
    }
  }
}

TEST(Round, HeapsSettle) {
  // From the shifted starts a small group once created energy: a contact found deeper than a moment before, in a piece of 3e-6 s.
  for (const auto& [crowd, shift] : {std::pair{false, 0.0}, {false, 0.003}, {false, 0.009}, {true, 0.0}}) {
    Settings settings;
    settings.threads = 1;
    World world(crowd ? testing::AsCrowd(settings) : settings);
    world.Add(Floor(0.5));
    testing::AddWalls(&world, 1.1, 1.6, 1);
    for (int i = 0; i < 14; ++i) {
      const Shape shape = i % 3 == 0   ? Shape::Capsule(0.08, 0.3)
                          : i % 3 == 1 ? Shape::Cylinder(0.1, 0.2)
                                       : Shape::Cylinder(0.25, 0.03);
      world.Add({.shape = shape,
                 .mass = 1,
                 .position_W = {0.2 * (i % 2) + shift, 0.15 * (i % 3) - 0.1, 0.6 + 0.8 * i},
                 .rotation_WB = Turn(0.7 * i, {1, 0.3 * i, 0.2}),
                 .friction = 0.5,
                 .restitution = 0.1});
    }
    int failed = 0;
    for (int frame = 0; frame < 200; ++frame) failed += world.Step(1.0 / 60).Failed();
    EXPECT_EQ(failed, 0) << crowd << " " << shift;
    double fastest = 0;
    for (const Body& b : world.bodies()) fastest = std::max(fastest, b.linear_velocity_W.norm());
    EXPECT_LT(fastest, 1) << crowd << " " << shift;  // what rolls on the floor or on its rim goes on
    for (int i = 5; i < 19; ++i) EXPECT_GT(world.body(i).position_W.z(), 0.02);
  }
}

// What lies in a heap of rods freezes as it comes to rest, whoever rolls on it: a contact at rest keeps the normal that it is found with.
TEST(Round, CrowdsOfRodsFreeze) {
  for (const bool capsules : {true, false}) {
    Settings settings;
    settings.threads = 1;
    World world(settings);
    world.Add(Floor(0.4));
    testing::AddWalls(&world, 0.75, 0.8, 0.3);
    for (int i = 0; i < 45; ++i) {
      const double radius = 0.02 + 0.01 * (i * 7 % 10) / 9, length = radius * (1 + 2.4 * (i * 3 % 10) / 9);
      world.Add({.shape = capsules ? Shape::Capsule(radius, length) : Shape::Cylinder(radius, length),
                 .density = 700,
                 .position_W = {0.24 * (i % 2) - 0.12, 0.24 * (i / 2 % 2) - 0.12, 0.2 + 0.36 * (i / 4)},
                 .rotation_WB = Turn(1.1 * i, {1, 0.3 * (i % 5), 0.2 * (i % 7) - 0.6}),
                 .friction = 0.4,
                 .restitution = 0.2});
    }
    int frozen = 0;
    for (int frame = 0; frame < 300; ++frame) frozen = world.Step(1.0 / 60).frozen;
    EXPECT_GE(frozen, 30) << capsules;
  }
}

// Coins that totter hit the floor and each other hundreds of times a second. Once they have cost more than their share they go with the
// crowd, in one piece a step or a few.
TEST(Round, CoinsThatTotterGoWithTheCrowd) {
  Settings settings;
  settings.threads = 1;
  World world(settings);
  world.Add(Floor(0.5));
  for (int i = 0; i < 12; ++i)
    world.Add({.shape = Shape::Cylinder(0.012, 0.001),
               .mass = 0.007,
               .position_W = {0.01 * (i % 3) - 0.01, 0.008 * (i % 4) - 0.01, 0.05 + 0.03 * i},
               .rotation_WB = Turn(0.4 * i, {1, 0.3 * i, 0.2}),
               .friction = 0.5,
               .restitution = 0.2});
  int pieces = 0, failed = 0;
  for (int frame = 0; frame < 120; ++frame) {
    const StepReport report = world.Step(1.0 / 60);
    pieces += report.pieces;
    failed += report.Failed();
  }
  EXPECT_EQ(failed, 0);
  EXPECT_LT(
      pieces,
      8000);  // 3,154 to 5,353 by chance: their course is chaotic. Without the rule a step takes ten times as long
  for (int i = 1; i <= 12; ++i) EXPECT_GT(world.body(i).position_W.z(), 0.0009);
}

// Without friction all forces on what is round pass through its axis, so nothing changes its spin about that, not even the slap of one that
// yaws as it falls over: a rod on a smooth floor had 16 times its spin after such a step.
TEST(Round, NormalForcesSpinNothingAboutItsAxis) {
  for (const double rate : {30.0, 60.0, 240.0}) {
    for (const Shape& shape : {Shape::Capsule(0.02, 0.1), Shape::Cylinder(0.02, 0.1)}) {
      for (const auto& [crowd, two] : {std::pair{false, false}, {false, true}, {true, false}}) {
        for (int seed = 0; seed < 6; ++seed) {
          World world(crowd ? testing::AsCrowd(Awake()) : Awake());
          world.Add(Floor(0));
          const Quaternion tilt = Turn(M_PI / 2 + 0.1 + 0.1 * seed, Vector3::UnitY());
          const Vector3 spin = 20.0 * (tilt * Vector3::UnitZ()) + Vector3(0, 0, 6.5 - seed);
          world.Add({.shape = shape,
                     .mass = 0.3,
                     .position_W = {0, 0, 0.25},
                     .rotation_WB = tilt,
                     .angular_velocity_W = spin,
                     .friction = 0});
          if (two)
            world.Add({.shape = shape,
                       .mass = 0.2,
                       .position_W = {0.03, 0.01, 0.02},
                       .rotation_WB = Turn(M_PI / 2, {1, 0.3 * seed, 0}),
                       .friction = 0});
          const auto own_spin = [&](int i) {
            return world.body(i).angular_velocity_W.dot(world.body(i).rotation_WB * Vector3::UnitZ());
          };
          std::vector<double> before;
          const int bodies = static_cast<int>(world.bodies().size());
          for (int i = 1; i < bodies; ++i) before.push_back(own_spin(i));
          StepTimes(&world, static_cast<int>(0.6 * rate), 1 / rate);
          for (int i = 1; i < bodies; ++i)
            EXPECT_NEAR(own_spin(i), before[i - 1],
                        two ? 0.1 : 1e-8)  // all but parallel ones have no normal through both
                << rate << " " << crowd << seed;
        }
      }
    }
  }
}

// A capsule falls on what is round and runs over it. Every step of 1/60 s from there on ends as 64 of them do. The place where two crossing
// rods touch runs along both, faster than anything on them; on a ball a normal impulse has to pass through its centre and the axis.
TEST(Round, RunsOverWhatIsRoundInWholeSteps) {
  struct Fall {
    Shape below;
    double friction;
    Vector3 place, axis, velocity, spin;
    double turn;
    int meets;  // steps of 1/3840 s until then
  };
  const Shape ball = Shape::Sphere(0.1), rod = Shape::Capsule(0.03, 0.3);
  for (const Fall& fall : {Fall{ball, 0, {-0.03, -0.01, 0.25}, {-1, 0, 1}, {0.7, 0.4, -1}, {-1, 3, -14}, -1.2, 276},
                           Fall{rod, 0.7, {0.01, 0, 0.18}, {1, -2, 1}, {0.5, -0.3, -1}, {-14, -14, 11}, 0.9, 234},
                           Fall{rod, 1, {-0.02, 0.02, 0.18}, {-1, 2, 1}, {-0.9, -0.6, -1}, {-8, 14, -4}, 0.6, 291}}) {
    for (int moment = 1; moment < 13; ++moment) {
      const auto after = [&](int steps) {
        World world(Awake());
        world.Add({.shape = fall.below,
                   .kind = BodyKind::kFixed,
                   .rotation_WB = Turn(M_PI / 2, Vector3::UnitY()),
                   .friction = fall.friction,
                   .restitution = 0});
        const int capsule = world.Add({.shape = Shape::Capsule(0.03, 0.08),
                                       .mass = 1,
                                       .position_W = fall.place,
                                       .rotation_WB = Turn(fall.turn, fall.axis.normalized()),
                                       .linear_velocity_W = fall.velocity,
                                       .angular_velocity_W = fall.spin,
                                       .friction = fall.friction,
                                       .restitution = 0});
        for (int k = 0; k < fall.meets + 16 * moment; ++k) testing::Step(&world, 1.0 / 3840);
        for (int k = 0; k < steps; ++k) EXPECT_EQ(testing::Step(&world, 1.0 / 60 / steps).gave_up, 0);
        return world.body(capsule);
      };
      const Body fine = after(64), coarse = after(1);
      EXPECT_LT((coarse.angular_velocity_W - fine.angular_velocity_W).norm(), 0.7) << fall.meets << " " << moment;
      EXPECT_LT((coarse.linear_velocity_W - fine.linear_velocity_W).norm(), 0.08) << fall.meets << " " << moment;
    }
  }
}

// A bar that rolls and slips off an equal one stays parallel to it, ends flush or not, and comes to the spin that a fine step gives. The place
// where two such axes cross is metres away for a billionth of tilt: levers were there.
TEST(Round, RollsOffABarBesideIt) {
  for (const Shape& below : Rollers()) {
    for (const bool capsule : {false, true}) {
      for (const double length : {0.3, 0.29, 0.2}) {
        const Shape above = capsule ? Shape::Capsule(kRadius, length) : Shape::Cylinder(kRadius, length);
        for (const double friction : {0.1, 0.5, 1.0}) {
          double spin[2];
          for (const bool fine : {true, false}) {
            const double rate = fine ? 1000 : 30;
            World world(Awake());
            BodyDefinition bar = Lying(below, 0);
            bar.kind = BodyKind::kFixed, bar.mass.reset(), bar.friction = friction;
            world.Add(bar);
            bar = Lying(above, 0);
            bar.friction = friction;
            bar.position_W = 2 * kRadius * Vector3(std::sin(0.3), 0, std::cos(0.3));
            bar.rotation_WB = Turn(fine ? 0 : 1e-9, {0, 0, 1}) * bar.rotation_WB;
            world.Add(bar);
            StepTimes(&world, static_cast<int>(0.8 * rate), 1 / rate);
            const Vector3 axis = world.body(1).rotation_WB * Vector3::UnitZ();
            EXPECT_LT(std::hypot(axis.x(), axis.z()), 1e-6) << capsule << length << friction;
            spin[fine] = world.body(1).angular_velocity_W.y();
          }
          EXPECT_NEAR(spin[0], spin[1], 0.15) << capsule << length << friction;
        }
      }
    }
  }
}

// Logs that fall into a valley come to rest along it, and sink into each other by no thousandth of a size.
TEST(Round, LogsSettleInAValley) {
  for (const int bodies : {20, 0}) {
    for (const Shape& log : {Shape::Capsule(0.05, 0.3), Shape::Cylinder(0.05, 0.3)}) {
      Settings settings;
      settings.threads = 1;
      settings.group_bodies = bodies;
      World world(settings);
      for (const double side : {-1.0, 1.0}) {
        BodyDefinition wall = Floor(0.3);
        wall.rotation_WB = Turn(side * 50 * M_PI / 180, Vector3::UnitX());
        world.Add(wall);
      }
      for (int i = 0; i < 15; ++i)
        world.Add({.shape = log,
                   .density = 600,
                   .position_W = {0.003 * (i * 7 % 5 - 2), 0.14 * (i % 3 - 1), 0.45 + 0.14 * (i / 3)},
                   .rotation_WB = Turn(0.01 * (i * 5 % 7 - 3), Vector3::UnitZ()) * Turn(M_PI / 2, Vector3::UnitY()),
                   .friction = 0.3,
                   .restitution = 0.1});
      double deepest = 0;
      for (int i = 0; i < 240; ++i) {
        const StepReport report = testing::Step(&world, 1.0 / 60);
        EXPECT_EQ(report.motion_failures, 0);
        deepest = std::max(deepest, report.penetration_max);
      }
      EXPECT_LT(deepest, 3e-3 * 0.1);
      const auto rolls = [](const Body& b) { return b.linear_velocity_W.norm() > 1e-3; };
      EXPECT_LE(std::count_if(world.bodies().begin(), world.bodies().end(), rolls),
                1);  // one may roll to and fro over two others
    }
  }
}

TEST(Round, ElasticCapsulesKeepTheirEnergy) {
  Settings settings = Awake();
  World world(settings);
  world.Add(Floor(0, 1));
  BodyDefinition capsule = Lying(Shape::Capsule(0.1, 0.3), 1);
  capsule.restitution = 1, capsule.friction = 0;
  capsule.rotation_WB = Turn(0.4, {1, 2, 0});
  capsule.angular_velocity_W = {1, 2, 3};
  world.Add(capsule);
  const double before = testing::Energy(world.bodies());
  StepTimes(&world, 600);
  EXPECT_NEAR(testing::Energy(world.bodies()), before, 1e-6 * before);
}

// A rod falls on another one across it at 5 m/s. Each end has a normal of its own, and which of them comes first is chance.
TEST(Round, RodsMeetAcrossWhicheverEndIsFirst) {
  for (const bool crowd : {false, true}) {
    Vector3 first = Vector3::Zero();
    for (const double turn : {0.0, M_PI}) {
      Settings settings = Awake();
      if (crowd) settings.group_bodies = 1;
      World world(settings);
      world.SetGravity({0, 0, 0});
      const int rod =
          world.Add({.shape = Shape::Capsule(0.005, 0.25),
                     .mass = 1,
                     .position_W = {0, 0, 0.05},
                     .rotation_WB = testing::Turn(turn, Vector3::UnitZ()) * testing::Turn(0.5 * M_PI, Vector3::UnitY()),
                     .linear_velocity_W = {0, 0, -5},
                     .friction = 0,
                     .restitution = 1});
      const Vector3 along(std::cos(0.25), std::sin(0.25), 0);
      world.Add({.shape = Shape::Capsule(0.005, 0.6),
                 .kind = BodyKind::kFixed,
                 .position_W = Vector3(-0.25, 0.0075, 0) + 0.24 * along,
                 .rotation_WB = testing::Turn(0.25, Vector3::UnitZ()) * testing::Turn(0.5 * M_PI, Vector3::UnitY()),
                 .friction = 0,
                 .restitution = 1});
      const double before = world.body(rod).KineticEnergy();
      EXPECT_FALSE(world.Step(1.0 / 60).Failed());
      const Body& b = world.body(rod);
      EXPECT_GT(b.linear_velocity_W.z(), -4.9) << turn << ": it hits";
      EXPECT_NEAR(b.KineticEnergy(), before, 1e-6 * before);
      if (turn == 0) first = b.linear_velocity_W;
      EXPECT_LT((b.linear_velocity_W - first).norm(), 1e-5) << crowd;
    }
  }
}

// In a crowd, which moves in one piece a step, a capsule that rolls about on its cap does not sink, however many steps it takes.
TEST(Round, RollsInACrowdWithoutSinking) {
  for (const double rate : {30.0, 240.0}) {
    World world(testing::AsCrowd(Awake()));
    world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed, .friction = 1});
    const double r = 0.2, h = 0.2;
    const Quaternion tilt = Turn(-0.6, {0, 1, 0});
    const Vector3 position = Vector3(0, 0, r) + tilt * Vector3(0, 0, h), spin(0.3, 4, 0);
    world.Add({.shape = Shape::Capsule(r, h),
               .mass = 1,
               .position_W = position,
               .rotation_WB = tilt,
               .linear_velocity_W = spin.cross(position),
               .angular_velocity_W = spin,
               .friction = 1,
               .restitution = 0});
    double deepest = 0;
    for (int i = 0; i < rate; ++i) deepest = std::max(deepest, world.Step(1 / rate).penetration_max);
    EXPECT_LT(deepest, 5e-4 * 2 * r) << rate;
  }
}

// A smooth wall pushes a row of balls up a slope at a constant speed. They roll alike, and touch without friction: the line of their centres
// never turns, however much they spin. (Where their spin turned it, balls of a crowd rubbed on the floor by their weight, and the row opened.)
TEST(Round, RowOfRollingBallsIsPushedUpASlope) {
  constexpr int kBalls = 25;
  constexpr double kSlope = 0.2, kBall = 0.05, kSpeed = 1;
  for (const double dt : {1.0 / 30, 1.0 / 240, 1.0 / 1000}) {
    Settings settings = testing::Awake();
    settings.gravity = {-testing::kGravity * std::sin(kSlope), 0, -testing::kGravity * std::cos(kSlope)};
    World world(settings);
    world.Add(testing::Floor(0.8));
    world.Add({.shape = Shape::Box({0.05, 1, 0.5}),
               .kind = BodyKind::kKinematic,
               .position_W = {-0.1, 0, 0.5},
               .linear_velocity_W = {kSpeed, 0, 0},
               .friction = 0,
               .restitution = 0});
    for (int k = 0; k < kBalls; ++k) {
      BodyDefinition ball = testing::Ball({2 * k * kBall, 0, kBall}, kBall, 0.8);
      ball.linear_velocity_W = {kSpeed, 0, 0};
      ball.angular_velocity_W = {0, kSpeed / kBall, 0};
      world.Add(ball);
    }
    world.SetMaterialCallback([](const Contact& contact, const Body& a, const Body& b) {
      const bool on_floor = a.kind == BodyKind::kFixed || b.kind == BodyKind::kFixed;
      return Material{on_floor ? contact.friction : 0, 0};
    });
    for (double t = 0; t < 0.3; t += dt) testing::Step(&world, dt);
    const double force = world.ImpulseOn(1).norm() / dt, right = kBalls * testing::kGravity * std::sin(kSlope);
    EXPECT_NEAR(force, right, 1e-4 * right) << dt;
    for (const Body& body : world.bodies().subspan(2)) EXPECT_NEAR(body.linear_velocity_W.x(), kSpeed, 1e-5) << dt;
  }
}

}  // namespace
}  // namespace islet
