// What slides or rolls on decks that turn, against Runge-Kutta's answer for a point, in small groups and in crowds. An impulse that is
// spread over a piece lies along the normal and against the slip of halfway.
#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::kGravity;

constexpr double kRadius = 0.15;

using State = Eigen::Vector4d;  // two coordinates [m], and their rates

State RungeKutta(State y, double time, const std::function<State(const State&)>& rate) {
  constexpr int kSteps = 20000;
  const double h = time / kSteps;
  for (int k = 0; k < kSteps; ++k) {
    const State a = rate(y), b = rate(y + h / 2 * a), c = rate(y + h / 2 * b), d = rate(y + h * c);
    y += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return y;
}

BodyDefinition Deck(double friction) {
  return {.shape = Shape::Box({9, 20, 0.1}),
          .kind = BodyKind::kKinematic,
          .position_W = {0, 0, -0.1},
          .friction = friction,
          .restitution = 0};
}

// A ball that hardly turns.
BodyDefinition Point(const Vector3& position, const Vector3& velocity, double friction) {
  BodyDefinition ball = testing::Ball(position, kRadius, friction, 0);
  ball.inertia_B = Matrix3(1e6 * Matrix3::Identity());
  ball.linear_velocity_W = velocity;
  return ball;
}

// It tilts at a constant rate. The press lies along the normal of halfway: along that of the end it braked by half of a step's turn.
TEST(TurningDeck, PointSlidesOnADeckThatTilts) {
  constexpr double kRate = 0.3, kFriction = 0.05, kTime = 1.5, kStart = 0.5, kSpeed = 4;
  double t = 0;
  const auto rate = [&](const State& y) -> State {  // y: way along the deck, the angle, their rates
    const double normal = kGravity * std::cos(y[1]) + 2 * y[2] * kRate - kRadius * kRate * kRate;
    return {y[2], kRate, y[0] * kRate * kRate - kGravity * std::sin(y[1]) - kFriction * normal, 0};
  };
  const double right = RungeKutta({kStart, 0, kSpeed + kRadius * kRate, kRate}, kTime, rate)[0];
  for (const bool crowd : {false, true}) {
    for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      BodyDefinition deck = Deck(kFriction);
      deck.angular_velocity_W = {kRate, 0, 0};
      world.Add(deck);
      const int b = world.Add(Point({0, kStart, kRadius}, {0, kSpeed, kStart * kRate}, kFriction));
      for (t = 0; t < kTime - dt / 2;) {
        t += dt;
        const Quaternion q = testing::Turn(kRate * t, Vector3::UnitX());
        world.MoveTo(0, q * Vector3(0, 0, -0.1), q, dt);
        testing::Step(&world, dt);
      }
      const Vector3 along = testing::Turn(kRate * t, Vector3::UnitX()) * Vector3::UnitY();
      EXPECT_NEAR(world.body(b).position_W.dot(along), right, 0.8 * dt * dt) << crowd << " " << dt;  // before: 2 dt
    }
  }
}

// A turntable turns the slip. Friction of a piece is against that of halfway.
TEST(TurningDeck, PointSlidesOnATurntable) {
  constexpr double kRate = 2, kFriction = 0.2, kTime = 1;
  const auto rate = [&](const State& y) -> State {
    const Eigen::Vector2d slip(y[2] + kRate * y[1], y[3] - kRate * y[0]);
    const Eigen::Vector2d a = -kFriction * kGravity * slip.normalized();
    return {y[2], y[3], a[0], a[1]};
  };
  const State right = RungeKutta({0.5, 0, 0.3, 0}, kTime, rate);
  for (const bool crowd : {false, true}) {
    for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      BodyDefinition deck = Deck(kFriction);
      deck.angular_velocity_W = {0, 0, kRate};
      world.Add(deck);
      const int b = world.Add(Point({0.5, 0, kRadius}, {0.3, 0, 0}, kFriction));
      for (int k = 0; k < kTime / dt - 0.5; ++k) testing::Step(&world, dt);
      EXPECT_LT((world.body(b).position_W.head<2>() - right.head<2>()).norm(), dt * dt) << crowd << " " << dt;
    }
  }
}

// A crowd of balls in a row that roll on a deck that the user rocks, and of rollers on a slab that turns on its own, go as one of them does.
// They sank by 2 % of their size, and went some centimetres astray.
TEST(TurningDeck, RowsRollAsOneDoes) {
  for (const bool driven : {true, false}) {
    for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
      double way[2], deep = 0;
      for (const int count : {1, 27}) {
        World world(Awake());
        BodyDefinition deck = Deck(0.9);
        if (!driven) {
          deck.kind = BodyKind::kDynamic;
          deck.mass = 1e7;
          deck.inertia_B = Matrix3(1e9 * Matrix3::Identity());
          deck.angular_velocity_W = {0.2, 0, 0};
          deck.linear_velocity_W = {0, 0.02, 0};
        }
        world.Add(deck);
        if (!driven) world.SetForce(0, {0, 0, 1e7 * kGravity}, Vector3::Zero());
        for (int i = 0; i < count; ++i) {
          BodyDefinition ball = testing::Ball({0.3 * (i - count / 2), 0.5, kRadius}, kRadius, 0.9, 0);
          if (!driven) {
            ball.shape = Shape::Cylinder(kRadius, 0.14);
            ball.rotation_WB = testing::Turn(0.5 * M_PI, Vector3::UnitY());
            ball.linear_velocity_W = {0, 0.02, 0.1};
          }
          world.Add(ball);
        }
        for (int k = 1; k <= 2 / dt + 0.5; ++k) {
          const double angle = 0.1 * (1 - std::cos(1.5 * k * dt));
          const Quaternion q = testing::Turn(angle, Vector3::UnitX());
          if (driven) world.MoveTo(0, q * Vector3(0, 0, -0.1), q, dt);
          testing::Step(&world, dt);
          const Body& at = world.body(0);
          const auto in_deck = [&](int i) {
            return (at.rotation_WB.conjugate() * (world.body(i).position_W - at.position_W)).eval();
          };
          for (int i = 1; i <= count; ++i) deep = std::max(deep, kRadius + 0.1 - in_deck(i).z());
          way[count > 1] = in_deck(1).y();
        }
      }
      EXPECT_NEAR(way[1], way[0], 0.2 * dt * dt) << driven << " " << dt;
      EXPECT_LT(deep, 0.15 * dt * dt) << driven << " " << dt;
    }
  }
}

// A box, askew to all axes, rides on a tilted deck that turns about the vertical and travels. It goes on an arc that is not along the deck: its
// pieces meet what the deck works under the arc.
TEST(TurningDeck, WhatRidesOnATiltedTurntableStaysThere) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240}) {
    World world(Awake());
    BodyDefinition deck = Deck(0.7);
    deck.shape = Shape::Box({1, 0.6, 0.05});
    deck.position_W = {-0.0147, 0, 0.2};
    deck.rotation_WB = Quaternion(0.9818175417, -0.0161994993, 0.0985103411, 0.1614546490).normalized();
    deck.linear_velocity_W = {-0.0802, 0, 0};
    deck.angular_velocity_W = {0, 0, 1.778};
    world.Add(deck);
    BodyDefinition box{
        .shape = Shape::Box({0.0693, 0.0811, 0.041583434}), .mass = 0.2, .friction = 0.7, .restitution = 0};
    box.position_W = {-0.0513191104, -0.0897657503, 0.3063034767};
    box.rotation_WB = Quaternion(0.9868612716, -0.0437828823, 0.0897205121, -0.1270358984).normalized();
    const Vector3 arm = box.position_W - deck.position_W;
    box.linear_velocity_W = deck.linear_velocity_W + deck.angular_velocity_W.cross(arm);
    box.angular_velocity_W = deck.angular_velocity_W;
    const int rides = world.Add(box);
    const auto place = [&] {
      const Body& under = world.body(0);
      return Vector3(under.rotation_WB.conjugate() * (world.body(rides).position_W - under.position_W));
    };
    const Vector3 before = place();
    int pieces = 0, steps = 0;
    for (double time = 0; time < 0.25 - 1e-9; time += dt, ++steps) {
      const StepReport report = world.Step(dt);
      EXPECT_FALSE(report.Failed()) << dt << " " << time;
      EXPECT_EQ(report.gave_up, 0) << dt << " " << time;
      pieces += report.pieces;
    }
    EXPECT_LE(pieces, 2 * steps) << dt;
    EXPECT_LT((place() - before).norm(), 5e-3 * dt) << dt;
  }
}

}  // namespace
}  // namespace islet
