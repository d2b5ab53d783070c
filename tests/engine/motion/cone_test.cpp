// What acts in a step: whatever happens within it, no contact pulls, and none rubs by more than its friction allows. On a floor, where all
// normals are alike, that holds of all that a body got.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::Floor;
using testing::kGravity;

Shape AnyShape(int kind, std::mt19937* random) {
  std::uniform_real_distribution<double> size(0.03, 0.15);
  switch (kind) {
    case 0:
      return Shape::Cylinder(size(*random), 0.3 * size(*random));
    case 1:
      return Shape::Box({size(*random), size(*random), size(*random)});
    case 2:
      return Shape::Capsule(0.5 * size(*random), size(*random));
    default: {
      std::vector<Vector3> corners;
      std::uniform_real_distribution<double> at(-0.12, 0.12);
      for (int k = 0; k < 12; ++k) corners.emplace_back(at(*random), at(*random), at(*random));
      return Shape::ConvexHull(corners);
    }
  }
}

// A body that is thrown onto a floor, tumbles and slides until it lies.
World Thrown(const Settings& settings, int kind, double friction, double restitution, std::mt19937* random) {
  World world(settings);
  std::uniform_real_distribution<double> any(-1, 1);
  world.Add(Floor(friction, restitution));
  world.Add({.shape = AnyShape(kind, random),
             .mass = 1,
             .position_W = {0, 0, 0.25},
             .rotation_WB = Quaternion(any(*random), any(*random), any(*random), any(*random)).normalized(),
             .linear_velocity_W = {3 * any(*random), 3 * any(*random), any(*random)},
             .angular_velocity_W = {9 * any(*random), 9 * any(*random), 9 * any(*random)},
             .friction = friction,
             .restitution = restitution});
  return world;
}

// Where a slide turned within a step, and less pressed at its end than all through it, friction took up to 7 % more than that (small groups),
// and 12 % (crowds), in a step of forty.
TEST(Cone, AllThatABodyGetsInAStepLiesInIt) {
  std::mt19937 random(7);
  for (const bool crowd : {false, true}) {
    for (int k = 0; k < 60; ++k) {
      const double friction = std::vector{0.1, 0.3, 0.6, 1.0}[k / 4 % 4], rate = std::vector{30, 60, 240}[k % 3];
      World world = Thrown(crowd ? testing::AsCrowd(Awake()) : Awake(), k % 4, friction, k % 5 == 0 ? 0.4 : 0, &random);
      for (int frame = 0; frame < rate; ++frame) {
        const Vector3 before = world.body(1).linear_velocity_W;
        const StepReport report = world.Step(1 / rate);
        if (report.gave_up > 0) continue;
        const Vector3 got = world.body(1).linear_velocity_W - before + Vector3(0, 0, kGravity / rate);
        EXPECT_LT(got.head<2>().norm(), friction * got.z() + 1e-6 * kGravity / rate)
            << crowd << " " << k << " " << frame;
      }
    }
  }
}

// Also where several contacts become one, and where freezing stops what is left.
TEST(Cone, NoContactOfACrowdPulls) {
  std::mt19937 random(8);
  for (int k = 0; k < 40; ++k) {
    const double rate = std::vector{30, 60, 240}[k % 3];
    World world = Thrown(testing::AsCrowd({}), k % 2, 0.4, k % 3 == 0 ? 0.4 : 0, &random);
    for (int frame = 0; frame < 1.5 * rate; ++frame) {
      world.Step(1 / rate);
      for (const Vector3& impulse : world.impulses()) EXPECT_GE(impulse.z(), -1e-9) << k << " " << frame;
    }
  }
}

}  // namespace
}  // namespace islet
