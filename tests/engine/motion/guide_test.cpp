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

}  // namespace
}  // namespace islet
