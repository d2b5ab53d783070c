// The ways that bodies go, and whom they meet on them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/motion/lever.h"
#include "engine/motion/visible_turn.h"
#include "engine/world.h"
#include "scenes/random.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;

// Dynamic: its axis circles its angular momentum. A wall turns as the user says. Both by up to a turn and more in the time of the way.
TEST(FreePath, HasTheAxisWhereItIs) {
  SplitMix64 random(5);
  for (int k = 0; k < 200; ++k) {
    const Shape shape = k % 2 == 0 ? Shape::Cylinder(0.1, 0.004) : Shape::Capsule(0.01, 0.2);
    Body body;
    body.kind = k % 4 < 2 ? BodyKind::kDynamic : BodyKind::kKinematic;
    body.inertia_B = (k % 2 == 0 ? Vector3(2.5, 2.5, 5) : Vector3(5, 5, 0.02)).asDiagonal();
    motion::State from;
    from.pose.rotation_WB = testing::Turn(random.Uniform(0, 3), random.Direction());
    from.angular_W = random.Uniform(0, 8) * random.Direction();
    const motion::Path path = motion::FreePath(body, shape, from, Vector3::Zero());
    const auto axis = [&](double t) -> Vector3 {
      const Quaternion turned = body.kind == BodyKind::kDynamic
                                    ? motion::TurnFreely(body, from.pose.rotation_WB, from.angular_W, t).rotation_WB
                                    : motion::Turned(t * from.angular_W, from.pose.rotation_WB);
      return turned * Vector3::UnitZ();
    };
    for (const double t : {0.1, 0.4, 1.0}) {
      EXPECT_NEAR((path.At(t).rotation_WB * Vector3::UnitZ() - axis(t)).norm(), 0, 1e-13) << k << ' ' << t;
      const double speed = shape.radius() * (axis(t + 1e-6) - axis(t - 1e-6)).norm() / 2e-6;
      EXPECT_NEAR(path.TurnSpeed(0, 1), speed, 1e-8 + 1e-8 * speed) << k << ' ' << t;
    }
  }
}

// A disc spins and wobbles beside a ball, a step alone: it hits the ball where steps of a 32th of it do.
TEST(Paths, DiscsThatWobblePassNobody) {
  SplitMix64 random(31);
  int hits = 0;
  for (int k = 0; k < 150; ++k) {
    const double dt = k % 2 == 0 ? 1.0 / 30 : 1.0 / 240, spin = random.Uniform(0.3, 4),
                 wobble = random.Uniform(0.02, 0.6);
    const double around = random.Uniform(0, 2 * std::numbers::pi), out = random.Uniform(0.05, 0.098);
    const double swing = std::min(2 * wobble / spin / 2, 1.0) * out, height = 0.0095 + random.Uniform(0, 1) * swing;
    const auto run = [&](int parts) {
      Settings settings = Awake();
      settings.gravity.setZero();
      World world(settings);
      world.Add({.shape = Shape::Cylinder(0.1, 0.004),
                 .mass = 0.1,
                 .angular_velocity_W = {wobble / dt, 0, spin / dt},
                 .friction = 0,
                 .restitution = 1});
      world.Add({.shape = Shape::Sphere(0.005),
                 .mass = 0.01,
                 .position_W = {out * std::cos(around), out * std::sin(around), k % 3 == 0 ? -height : height},
                 .friction = 0,
                 .restitution = 1});
      testing::StepTimes(&world, parts, dt / parts);
      return world.body(1).linear_velocity_W.norm();
    };
    const double fine = run(32);
    if (fine == 0) continue;
    ++hits;
    EXPECT_GT(run(1), 0.1 * fine) << k;
  }
  EXPECT_GT(hits, 20);
}

}  // namespace
}  // namespace islet
