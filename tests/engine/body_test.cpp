#include "engine/body.h"

#include <cmath>

#include <gtest/gtest.h>

namespace islet {
namespace {

Body Plank() {
  Body body;
  body.mass = 2;
  body.inertia_B = Vector3(1, 2, 4).asDiagonal();
  body.position_W = {1, 1, 1};
  // A quarter turn about z: B's x axis along W's y.
  body.rotation_WB = Quaternion(std::sqrt(0.5), 0, 0, std::sqrt(0.5));
  return body;
}

TEST(Body, InertiaTurnsWithTheBody) {
  const Matrix3 expected = Vector3(2, 1, 4).asDiagonal();
  EXPECT_TRUE(Plank().InertiaW().isApprox(expected, 1e-14));
  EXPECT_TRUE((Plank().InverseInertiaW() * expected).isApprox(Matrix3::Identity(), 1e-14));
}

TEST(Body, EnergyAndMomentum) {
  Body body = Plank();
  body.linear_velocity_W = {3, 0, 4};
  body.angular_velocity_W = {1, 1, 1};
  EXPECT_NEAR(body.KineticEnergy(), 25 + 0.5 * (2 + 1 + 4), 1e-13);
  EXPECT_TRUE(body.AngularMomentumW().isApprox(Vector3(2, 1, 4), 1e-14));
}

TEST(Body, VelocityOfAPoint) {
  Body body = Plank();
  body.linear_velocity_W = {1, 0, 0};
  body.angular_velocity_W = {0, 0, 2};
  EXPECT_TRUE(body.VelocityAt({2, 1, 5}).isApprox(Vector3(1, 2, 0)));
}

TEST(Body, ImpulseAtACorner) {
  Body body = Plank();
  body.ApplyImpulse({0, 0, 4}, {1, 2, 1});  // lever (0, 1, 0): torque impulse (4, 0, 0)
  EXPECT_TRUE(body.linear_velocity_W.isApprox(Vector3(0, 0, 2)));
  EXPECT_TRUE(body.angular_velocity_W.isApprox(Vector3(2, 0, 0), 1e-14));
}

TEST(Body, MovesOnlyWhenDynamicAndAwake) {
  Body body;
  EXPECT_TRUE(body.Moves());
  body.frozen = true;
  EXPECT_FALSE(body.Moves());
  body.frozen = false;
  body.removed = true;
  EXPECT_FALSE(body.Moves());
  body.removed = false;
  body.kind = BodyKind::kKinematic;
  EXPECT_FALSE(body.Moves());
}

}  // namespace
}  // namespace islet
