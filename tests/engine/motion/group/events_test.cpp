// Pieces end where a slip or a support ends (engine/motion): scenes whose answer is known, at any step.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Floor;
using testing::kGravity;

struct Slab {
  double mass, friction, speed;  // friction: of its lower side
};

struct Course {
  std::vector<double> x, v;  // per slab
};

// Slabs on each other that rub, by tiny steps of implicit friction: another method, one dimension, no contact code.
Course RubSlabs(const std::vector<Slab>& slabs, double seconds) {
  constexpr double kStep = 2e-5;
  const size_t n = slabs.size();
  Course course{std::vector<double>(n, 0.0), {}};
  for (const Slab& s : slabs) course.v.push_back(s.speed);
  std::vector<double> most(n), gave(n, 0.0);
  double above = 0;
  for (size_t i = n; i-- > 0;) {
    above += slabs[i].mass;
    most[i] = slabs[i].friction * kGravity * above * kStep;
  }
  for (double t = 0; t < seconds - 0.5 * kStep; t += kStep) {
    const std::vector<double> before = course.v;
    for (size_t i = 0; i < n; ++i) {
      course.v[i] += gave[i] / slabs[i].mass;
      if (i > 0) course.v[i - 1] -= gave[i] / slabs[i - 1].mass;
    }
    for (double change = 1; change > 1e-12;) {
      change = 0;
      for (size_t i = 0; i < n; ++i) {
        const double slip = course.v[i] - (i > 0 ? course.v[i - 1] : 0);
        const double light = 1 / slabs[i].mass + (i > 0 ? 1 / slabs[i - 1].mass : 0);
        const double next = std::clamp(gave[i] - slip / light, -most[i], most[i]), more = next - gave[i];
        gave[i] = next;
        course.v[i] += more / slabs[i].mass;
        if (i > 0) course.v[i - 1] -= more / slabs[i - 1].mass;
        change = std::max(change, std::abs(more) / slabs[i].mass);
      }
    }
    for (size_t i = 0; i < n; ++i) course.x[i] += 0.5 * kStep * (before[i] + course.v[i]);
  }
  return course;
}

// Whoever slides may stop, turn back, or be taken along within a step: it does so when it does, not when the step ends.
TEST(Events, SlabsThatRubStopWhenTheyStop) {
  const std::vector<std::vector<Slab>> stacks = {
      {{1.88, 0.7, 0.35}, {4.96, 0.75, -0.97}, {1.12, 0.2, -0.9}},
      {{0.77, 0.1, 0.83}, {3.68, 0.6, -0.66}},
      {{0.25, 0.22, -0.78}, {1.09, 0.63, 0.92}},
  };
  for (const std::vector<Slab>& slabs : stacks) {
    const Course exact = RubSlabs(slabs, 0.4);
    for (const double rate : {30.0, 60.0, 240.0}) {
      World world(testing::Awake());
      world.Add(Floor(1, 0));
      std::vector<int> numbers;
      for (size_t i = 0; i < slabs.size(); ++i) {
        BodyDefinition slab{.shape = Shape::Box({1, 0.5, 0.02}),
                            .mass = slabs[i].mass,
                            .position_W = {0, 0, 0.02 + 0.04 * static_cast<double>(i)},
                            .restitution = 0};
        slab.linear_velocity_W = {slabs[i].speed, 0, 0};
        numbers.push_back(world.Add(slab));
      }
      world.SetMaterialCallback([&](const Contact& c, const Body&, const Body&) -> Material {
        return {slabs[static_cast<size_t>(std::max(c.body_a, c.body_b) - numbers[0])].friction, 0};
      });
      testing::StepTimes(&world, static_cast<int>(std::lround(0.4 * rate)), 1 / rate);
      for (size_t i = 0; i < slabs.size(); ++i) {
        const Body& b = world.body(numbers[i]);
        EXPECT_NEAR(b.position_W.x(), exact.x[i], 2e-4)
            << slabs.size() << " slabs, " << i << ", " << rate;  // before: 1e-2
        EXPECT_NEAR(b.linear_velocity_W.x(), exact.v[i], 2e-3) << slabs.size() << " slabs, " << i << ", " << rate;
      }
    }
  }
}

// A ball, a cylinder, a capsule leave a table in the middle of a step: they fall from then on, and no energy is lost on the edge.
TEST(Events, WhatRunsOffAnEdgeFallsFromThereOn) {
  const double speed = 2, radius = 0.05;
  const std::vector<Shape> shapes = {Shape::Sphere(radius), Shape::Cylinder(radius, 0.1), Shape::Capsule(radius, 0.1)};
  for (const Shape& shape : shapes) {
    for (const double friction : {0.0, 0.5}) {
      for (const double rate : {30.0, 60.0, 240.0}) {
        for (const double start : {0.2, 0.215, 0.23, 0.245, 0.26}) {
          World world(testing::Awake());
          world.Add({.shape = Shape::Box({1, 1, 0.5}),
                     .kind = BodyKind::kFixed,
                     .position_W = {-1, 0, -0.5},
                     .friction = friction,
                     .restitution = 0});
          BodyDefinition body{
              .shape = shape, .mass = 1, .position_W = {-start, 0, radius}, .friction = friction, .restitution = 0};
          body.rotation_WB = testing::Turn(0.5 * std::numbers::pi, Vector3::UnitX());
          body.linear_velocity_W = {speed, 0, 0};
          if (friction > 0) body.angular_velocity_W = {0, speed / radius, 0};
          const int number = world.Add(body);
          while (world.body(number).position_W.x() < 0.05) testing::Step(&world, 1 / rate);
          const Vector3 v = world.body(number).linear_velocity_W;
          const double falls = world.time() - start / speed;
          EXPECT_NEAR(v.z(), -kGravity * falls, 0.03 * kGravity / rate) << rate << " " << start;  // before: up to 1
          EXPECT_NEAR(v.x(), speed, 1e-3) << rate << " " << start;
          EXPECT_NEAR(world.body(number).position_W.z(), radius - 0.5 * kGravity * falls * falls, 1e-4)
              << rate << " " << start;
        }
      }
    }
  }
}

// [rad/s] with which a smooth box of 0.2 m leaves a table at that speed, which it reaches with its front edge after a share of a step. Both go
// with `along` [m/s].
double SpinOverTheEdge(double speed, double from, double dt, const Vector3& along = Vector3::Zero()) {
  World world(testing::Awake());
  world.Add({.shape = Shape::Box({2, 0.5, 0.5}),
             .kind = BodyKind::kKinematic,
             .position_W = {-2, 0, -0.5},
             .linear_velocity_W = along,
             .friction = 0});
  BodyDefinition box{.shape = Shape::Box({0.1, 0.1, 0.05}), .mass = 1, .friction = 0, .restitution = 0};
  box.position_W = {from, 0, 0.05};
  box.linear_velocity_W = along + Vector3(speed, 0, 0);
  const int number = world.Add(box);
  while (world.body(number).position_W.x() - world.body(0).position_W.x() < 2.16) testing::Step(&world, dt);
  return world.body(number).angular_velocity_W.y();
}

// What slides over the edge of a table tips about it until its rear has passed. In one step of 1/30 s it may do all of that. The forces with
// which the step begins part it from the edge too soon, and then it fell without a turn: at 2.5 m/s in each phase of the step.
TEST(Events, BoxesThatLeaveATableTurn) {
  for (const double speed : {1.0, 1.5, 2.5}) {
    const double right = SpinOverTheEdge(speed, -0.12, 1.0 / 1920);
    for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
      const double most = speed * dt < 0.02 ? 0.03 : speed * dt < 0.07 ? 0.08 : 0.25;
      double sum = 0;
      for (int phase = 0; phase < 16; ++phase) {
        const double off = std::abs(SpinOverTheEdge(speed, -0.12 - phase * speed * dt / 16, dt) / right - 1);
        EXPECT_LT(off, most) << speed << ' ' << dt << ' ' << phase;
        sum += off;
      }
      EXPECT_LT(sum / 16, 0.4 * most) << speed << ' ' << dt;
    }
  }
}

// A box turns on a smooth ball, which bears it for a part of the step only. By the forces of the start it would part from the ball at once, by
// those of the whole step the ball bears it to its end.
TEST(Events, WhatTurnsOffABallLeavesItWhenItDoes) {
  const auto after = [](int steps) {
    World world(testing::Awake());
    world.Add({.shape = Shape::Sphere(0.1), .kind = BodyKind::kFixed, .restitution = 0});
    const int box = world.Add({.shape = Shape::Box({0.08, 0.1, 0.05}),
                               .mass = 1,
                               .position_W = {-0.01, 0, 0.25},
                               .rotation_WB = testing::Turn(1.2, Vector3(2, 0, -1).normalized()),
                               .linear_velocity_W = {-0.8, 0.5, -1},
                               .angular_velocity_W = {-4, -8, -15},
                               .friction = 0,
                               .restitution = 0});
    for (int k = 0; k < 265; ++k) testing::Step(&world, 1.0 / 3840);
    for (int k = 0; k < steps; ++k) testing::Step(&world, 1.0 / 60 / steps);
    return world.body(box);
  };
  const Body fine = after(64), coarse = after(1);
  EXPECT_LT((coarse.angular_velocity_W - fine.angular_velocity_W).norm(), 0.02);
  EXPECT_LT((coarse.linear_velocity_W - fine.linear_velocity_W).norm(), 0.002);
}

// A box that tumbles falls on a smooth fixed ball, or on a rod. From the moment before they touch one step ends as 64 do: it bears for a part
// of the step, with a force that falls from moment to moment.
TEST(Events, WhatTumblesOverWhatIsRoundBearsAsInFineSteps) {
  struct Fall {
    bool rod;
    Vector3 axis;
    double angle;
    Vector3 spin_W, velocity_W;
    double x;    // [m]
    int before;  // steps of 1/3840 s until they touch
  };
  for (const Fall& fall : {Fall{false, {2, 0, 2}, 1.4, {8, 12, 5}, {-0.4, 0.6, -2}, 0.02, 140},
                           Fall{false, {1, -2, 2}, -1.5, {8, 7, -4}, {0.1, -0.7, -2}, -0.02, 124},
                           Fall{false, {2, 0, -2}, -1.9, {-9, 8, -9}, {-0.4, 0.2, -2}, 0.04, 186},
                           Fall{true, {-1, 0, 0}, -0.8, {-7, -3, 5}, {-0.1, 0.1, -2}, 0.03, 226}}) {
    const auto after = [&fall](int steps) {
      World world(testing::Awake());
      world.Add({.shape = fall.rod ? Shape::Cylinder(0.1, 0.5) : Shape::Sphere(0.1),
                 .kind = BodyKind::kFixed,
                 .rotation_WB = testing::Turn(M_PI / 2, Vector3::UnitY()),
                 .friction = 0,
                 .restitution = 0});
      const int box = world.Add({.shape = Shape::Box({0.08, 0.1, 0.05}),
                                 .mass = 1,
                                 .position_W = {fall.x, 0, 0.3},
                                 .rotation_WB = testing::Turn(fall.angle, fall.axis.normalized()),
                                 .linear_velocity_W = fall.velocity_W,
                                 .angular_velocity_W = fall.spin_W,
                                 .friction = 0,
                                 .restitution = 0});
      testing::StepTimes(&world, fall.before, 1.0 / 3840);
      testing::StepTimes(&world, steps, 1.0 / 60 / steps);
      return world.body(box);
    };
    const Body fine = after(64), coarse = after(1);
    EXPECT_LT((coarse.linear_velocity_W - fine.linear_velocity_W).norm(), 0.015) << fall.before;
    EXPECT_LT((coarse.angular_velocity_W - fine.angular_velocity_W).norm(), 0.15) << fall.before;
  }
}

// A box spins like a top, face on face: pieces of a small turn would be a thousand in a step.
TEST(Events, WhatSpinsFastNeedsNoMorePiecesThanAStepMayHave) {
  World world(testing::Awake());
  world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed, .friction = 0.1});
  const int box = world.Add({.shape = Shape::Box({0.05, 0.05, 0.02}),
                             .mass = 1,
                             .position_W = {0, 0, 0.02},
                             .angular_velocity_W = {0, 0, 1000},
                             .friction = 0.1,
                             .restitution = 0});
  for (int k = 0; k < 6; ++k) {
    const StepReport report = testing::Step(&world, 1.0 / 60);
    EXPECT_EQ(report.gave_up, 0);
    EXPECT_LE(report.pieces, 64);
  }
  EXPECT_GT(world.body(box).angular_velocity_W.z(), 995);
}

// Its rear edge leaves the table's edge in some piece, however short, and gets no kick from it: of 400 phases ten once left a third faster.
TEST(Events, EdgesThatPartKickNobody) {
  for (const double speed : {1.0, 1.5}) {
    const double right = SpinOverTheEdge(speed, -0.12, 1.0 / 1920);
    for (int phase = 0; phase < 400; ++phase)
      EXPECT_NEAR(SpinOverTheEdge(speed, -0.12 - phase * speed / 60 / 400, 1.0 / 60) / right, 1, 0.04)
          << speed << phase;
  }
}

TEST(Events, EdgesThatAreLeftMayMove) {
  for (const Vector3& along : {Vector3(5, 0, 0), Vector3(-8, 6, 0), Vector3(0, 20, 0), Vector3(0, 0, 3)})
    for (int phase = 0; phase < 16; ++phase) {
      const double from = -0.12 - phase * 1.5 / 30 / 16;
      EXPECT_NEAR(SpinOverTheEdge(1.5, from, 1.0 / 30, along), SpinOverTheEdge(1.5, from, 1.0 / 30), 1e-6)
          << along << phase;
    }
}

// A smooth box that slides from one table to the next, over a gap of less than half its length, is lifted by no edge.
TEST(Events, EdgesThatAreLeftKickNobody) {
  for (int k = 0; k < 120; ++k) {
    const double gap = 0.02 + 0.0005 * k, speed = 1 + 0.0161 * k, dt = k % 2 == 0 ? 1.0 / 30 : 1.0 / 60;
    World world(testing::Awake());
    for (const double middle : {-1.0, 2 + gap})
      world.Add({.shape = Shape::Box({std::abs(middle + (middle < 0 ? 0 : -gap)), 0.5, 0.5}),
                 .kind = BodyKind::kFixed,
                 .position_W = {middle, 0, -0.5},
                 .friction = 0});
    BodyDefinition box{.shape = Shape::Box({0.1, 0.1, 0.05}), .mass = 1, .friction = 0, .restitution = 0};
    box.position_W = {-0.15 - 0.00083 * k, 0, 0.05};
    box.linear_velocity_W.x() = speed;
    const int number = world.Add(box);
    while (world.body(number).position_W.x() < 0.3) testing::Step(&world, dt);
    EXPECT_LT(world.body(number).angular_velocity_W.norm(), 1e-9) << k;
    EXPECT_NEAR(world.body(number).linear_velocity_W.x(), speed, 1e-9) << k;
  }
}

// A disc of a hundred corners slides and stops, each of which bears a hundredth of its weight: what ends is asked of all of them.
TEST(Events, SlideOnManyCornersStopsWhenItDoes) {
  for (const double dt : {1.0 / 30, 1.0 / 120}) {
    std::vector<Vector3> corners;
    for (int i = 0; i < 200; ++i) {
      const Vector3 rim = testing::Turn(2 * std::numbers::pi * (i / 2) / 100, Vector3::UnitZ()) * Vector3(0.05, 0, 0);
      corners.push_back(rim + Vector3(0, 0, i % 2 ? 0.01 : -0.01));
    }
    World world(testing::Awake());
    world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed, .friction = 0.35, .restitution = 0});
    world.Add({.shape = Shape::ConvexHull(corners),
               .position_W = {0, 0, 0.01},
               .linear_velocity_W = {0.3, 0, 0},
               .friction = 0.35,
               .restitution = 0});
    testing::StepTimes(&world, static_cast<int>(0.2 / dt), dt);
    EXPECT_NEAR(world.body(1).position_W.x(), 0.3 * 0.3 / (2 * 0.35 * kGravity), 1e-9) << dt;
  }
}

// A floor that coasts is as good as one that stands, in a world's first step, too. There a slide on it was taken for a ride, and had no end: a
// block that is set off, and topples, had tilted by a third too much.
TEST(Events, SlidesOnAFloorThatCoastsEndInTheFirstStep) {
  for (const double rate : {30.0, 60.0}) {
    for (const double speed : {0.5, 1.0}) {
      double tilts[2];
      for (const bool coasts : {false, true}) {
        const Vector3 floor(coasts ? 0.01 : 0, 0, 0);
        World world(testing::Awake());
        world.Add({.shape = Shape::Box({50, 50, 0.5}),
                   .kind = coasts ? BodyKind::kKinematic : BodyKind::kFixed,
                   .position_W = {0, 0, -0.5},
                   .linear_velocity_W = floor,
                   .friction = 1,
                   .restitution = 0});
        const int block = world.Add({.shape = Shape::Box({0.1, 0.2, 0.5}),
                                     .mass = 1,
                                     .position_W = {0, 0, 0.5},
                                     .linear_velocity_W = floor + Vector3(speed, 0, 0),
                                     .friction = 1,
                                     .restitution = 0});
        world.Step(1 / rate);
        tilts[coasts] = 2 * std::asin(world.body(block).rotation_WB.y());
      }
      EXPECT_GT(tilts[0], 0.005);
      EXPECT_NEAR(tilts[1], tilts[0], 1e-9) << rate << " " << speed;
    }
  }
}

// A plate slides and is pushed across: its slip turns by up to a radian within a step. dv/dt = F / m - mu g v / |v|, by Euler's method in parts of a
// 10,000th.
TEST(Events, SlipsThatTurnWithinAStep) {
  for (const double rate : {30.0, 60.0, 120.0})
    for (const double push : {0.6, 1.0, 2.0, 5.0}) {
      World world(testing::Awake());
      world.Add(testing::Floor(0.5, 0));
      world.Add({.shape = Shape::Box({0.5, 0.5, 0.05}),
                 .mass = 1,
                 .position_W = {0, 0, 0.05},
                 .linear_velocity_W = {0.3, 0, 0},
                 .friction = 0.5,
                 .restitution = 0});
      world.SetForce(1, {0, push * testing::kGravity, 0}, Vector3::Zero());
      testing::Step(&world, 1 / rate);
      Vector3 v(0.3, 0, 0);
      for (int i = 0; i < 10000; ++i)
        v += 1e-4 / rate * testing::kGravity * (Vector3(0, push, 0) - 0.5 * v.normalized());
      EXPECT_LT((world.body(1).linear_velocity_W - v).norm(), 0.012 * v.norm()) << rate << " " << push;
    }
}

}  // namespace
}  // namespace islet
