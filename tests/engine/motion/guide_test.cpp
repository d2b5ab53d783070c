// What moves in guides with hardly any play.
#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;

// A bar that moves into a guide, pressed askew by a torque, keeps its speed however little play there is. What is open by the play was
// held as closed, and four normals that differ by 1e-4 rad hold a bar for good.
TEST(Guide, BarKeepsItsSpeed) {
  for (const bool crowd : {false, true}) {
    for (const double play : {1e-5, 3e-5, 2e-4}) {
      for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240, 1.0 / 1000}) {
        Settings settings = crowd ? testing::AsCrowd(Awake()) : Awake();
        settings.gravity.setZero();
        World world(settings);
        for (const int side : {-1, 1})
          world.Add({.shape = Shape::Box({0.5, 0.1, 0.3}),
                     .kind = BodyKind::kFixed,
                     .position_W = {-0.5, side * (0.2 + play), 0},
                     .friction = 0,
                     .restitution = 0});
        const int b = world.Add({.shape = Shape::Box({0.3, 0.1, 0.1}),
                                 .mass = 1,
                                 .linear_velocity_W = {-1, 0, 0},
                                 .friction = 0,
                                 .restitution = 0});
        world.SetForce(b, Vector3::Zero(), {0, 0, 3});
        for (int k = 0; k < 0.1 / dt - 0.5; ++k) testing::Step(&world, dt);
        EXPECT_NEAR(world.body(b).linear_velocity_W.x(), -1, 2.5e-3) << crowd << " " << play << " " << dt;
      }
    }
  }
}

// A box that fits between two rails to the last bit, on a smooth floor, goes with whatever pulls it: rails press nobody who was not squeezed.
TEST(Guide, DrawerOpens) {
  for (const bool crowd : {false, true}) {
    for (const double pull : {5.0, 400.0}) {
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      world.Add(testing::Floor(0));
      for (const double side : {-0.6, 0.6})
        world.Add({.shape = Shape::Box({30, 0.1, 0.5}), .kind = BodyKind::kFixed, .position_W = {0, side, 0.5}});
      const int drawer = world.Add(testing::Cube({0, 0, 0.5}));
      world.SetForce(drawer, {pull, 0, 0}, Vector3::Zero());
      for (int k = 0; k < 30; ++k) testing::Step(&world, 1.0 / 60);
      EXPECT_NEAR(world.body(drawer).linear_velocity_W.x(), 0.5 * pull, 1e-3 * pull) << crowd;
    }
  }
}

// A roller that locks between a plate and an incline, pushed by forces alone, without weight: nothing moves, and nothing is at hand but what
// the forces would give. The ledger must find no fault with rounding.
TEST(Guide, RollerThatLocksIsClean) {
  constexpr double kAngle = 0.9, kRadius = 0.1, kFriction = 0.5;
  for (const double dt : {1.0 / 240, 1.0 / 1000}) {
    Settings settings = Awake();
    settings.gravity.setZero();
    World world(settings);
    BodyDefinition floor = testing::Floor(0);
    floor.position_W = {0, 0, -0.1};
    world.Add(floor);
    const int plate =
        world.Add({.shape = Shape::Box({2, 0.3, 0.05}), .mass = 1, .position_W = {0, 0, -0.05}, .friction = kFriction});
    BodyDefinition incline = testing::Floor(kFriction);
    incline.rotation_WB = testing::Turn(M_PI + kAngle, Vector3::UnitY());
    incline.position_W = Vector3(0, 0, kRadius) - kRadius * (incline.rotation_WB * Vector3::UnitZ());
    const int wall = world.Add(incline);
    const int roller = world.Add({.shape = Shape::Cylinder(kRadius, 0.2),
                                  .mass = 0.5,
                                  .position_W = {0, 0, kRadius},
                                  .rotation_WB = testing::Turn(0.5 * M_PI, Vector3::UnitX()),
                                  .friction = kFriction});
    world.SetCollision(plate, wall, false);
    world.SetCollision(roller, 0, false);
    world.SetForce(plate, {50, 0, 0}, Vector3::Zero());
    world.SetForce(roller, {1, 0, 0}, Vector3::Zero());
    for (int k = 0; k < 0.3 / dt; ++k) EXPECT_FALSE(world.Step(dt).Failed()) << dt << " " << k;
    EXPECT_LT((world.body(roller).position_W - Vector3(0, 0, kRadius)).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace islet
