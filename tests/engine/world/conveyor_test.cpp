// Surfaces that move along themselves: what lies on a belt goes as Coulomb's law says, and the ledger knows who works.
#include <cmath>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::AsCrowd;
using testing::Awake;
using testing::Cube;
using testing::kGravity;

constexpr double kBelt = 2, kFriction = 0.4;  // [m/s]

int AddBelt(World* world) {
  const int belt = world->Add({.shape = Shape::Box({20, 2, 0.5}),
                               .kind = BodyKind::kFixed,
                               .position_W = {0, 0, -0.5},
                               .friction = kFriction,
                               .restitution = 0});
  world->SetSurfaceVelocity(belt, {kBelt, 0, 0});
  return belt;
}

void StepClean(World* world, double seconds, double dt) {
  for (int i = 0; i < std::lround(seconds / dt); ++i) {
    const StepReport report = world->Step(dt);
    EXPECT_FALSE(report.Failed()) << i << ": energy " << report.ledger.energy_created.value;
  }
}

// It slides at mu g until it is as fast as the belt, after v / (mu g), and then goes along.
TEST(Conveyor, TakesACubeAlong) {
  for (const bool crowd : {false, true}) {
    for (const double dt : {1.0 / 30, 1.0 / 240}) {
      World world(crowd ? AsCrowd(Awake()) : Awake());
      AddBelt(&world);
      const int cube = world.Add(Cube({0, 0, 0.5}, kFriction));
      StepClean(&world, 0.4, dt);
      EXPECT_NEAR(world.body(cube).linear_velocity_W.x(), kFriction * kGravity * 0.4, 1e-5);
      StepClean(&world, 1.6, dt);
      EXPECT_NEAR(world.body(cube).linear_velocity_W.x(), kBelt, 1e-6);
      const double slides = kBelt / (kFriction * kGravity);
      EXPECT_NEAR(world.body(cube).position_W.x(), kBelt * (2 - 0.5 * slides), crowd ? 0.5 * kBelt * dt : 1e-2) << dt;
    }
  }
}

// Slip is over when v + w r, 7/2 of v, is the belt's speed.
TEST(Conveyor, SpinsABall) {
  World world(Awake());
  AddBelt(&world);
  const int ball = world.Add(testing::Ball({0, 0, 0.5}, 0.5, kFriction));
  StepClean(&world, 1, 1.0 / 60);
  EXPECT_NEAR(world.body(ball).linear_velocity_W.x(), 2 * kBelt / 7, 1e-6);
}

TEST(Conveyor, RunsUnderWhatIsHeldBack) {
  Settings settings;
  settings.threads = 1;
  World world(settings);
  const int belt = AddBelt(&world);
  world.Add({.shape = Shape::Box({0.5, 2, 0.5}),
             .kind = BodyKind::kFixed,
             .position_W = {1, 0, 0.5},
             .friction = 0,
             .restitution = 0});
  const int cube = world.Add(Cube({0, 0, 0.5}, kFriction));
  StepClean(&world, 2, 1.0 / 60);
  EXPECT_NEAR(world.body(cube).linear_velocity_W.norm(), 0, 1e-9);
  EXPECT_NEAR(testing::ImpulseOn(world, belt).x(), -kFriction * kGravity / 60, 1e-6);
  world.SetSurfaceVelocity(belt, {-kBelt, 0, 0});
  StepClean(&world, 1, 1.0 / 60);
  EXPECT_NEAR(world.body(cube).linear_velocity_W.x(), -kBelt, 1e-6);
}

// A body with a belt of its own drives off.
TEST(Conveyor, DrivesABodyOnItsTracks) {
  World world(Awake());
  world.Add(testing::Floor(kFriction));
  const int tank = world.Add(Cube({0, 0, 0.5}, kFriction));
  world.SetSurfaceVelocity(tank, {-kBelt, 0, 0});
  StepClean(&world, 2, 1.0 / 60);
  EXPECT_NEAR(world.body(tank).linear_velocity_W.x(), kBelt, 1e-6);
}

TEST(Conveyor, RefusesWhatIsNoVelocity) {
  World world(Awake());
  const int belt = AddBelt(&world);
  EXPECT_THROW(world.SetSurfaceVelocity(belt, {NAN, 0, 0}), std::invalid_argument);
  EXPECT_THROW(world.SetSurfaceVelocity(belt + 1, {0, 0, 0}), std::exception);
  EXPECT_EQ(world.body(belt).surface_velocity_B.x(), kBelt);
}

}  // namespace
}  // namespace islet
