#include "engine/contact.h"

#include <random>

#include <gtest/gtest.h>

namespace islet {
namespace {

void ExpectFrame(const Matrix3& frame, const Vector3& normal, double tolerance) {
  EXPECT_EQ(frame.col(0), normal);
  EXPECT_LE((frame.transpose() * frame - Matrix3::Identity()).norm(), tolerance) << normal.transpose();
  EXPECT_NEAR(frame.determinant(), 1, tolerance);
}

TEST(ContactFrame, UpwardNormalKeepsXAndY) {
  const Matrix3 frame = ContactFrame(Vector3::UnitZ());
  EXPECT_LE((frame.col(1) - Vector3::UnitX()).norm(), 1e-15);
  EXPECT_LE((frame.col(2) - Vector3::UnitY()).norm(), 1e-15);
}

TEST(ContactFrame, OrthonormalAndRightHandedEverywhere) {
  for (int axis = 0; axis < 3; ++axis) {
    ExpectFrame(ContactFrame(Vector3::Unit(axis)), Vector3::Unit(axis), 1e-14);
    ExpectFrame(ContactFrame(-Vector3::Unit(axis)), -Vector3::Unit(axis), 1e-14);
  }
  std::mt19937 rng(3);
  std::normal_distribution<double> gauss;
  for (int trial = 0; trial < 10000; ++trial) {
    const Vector3 normal = Vector3(gauss(rng), gauss(rng), gauss(rng)).normalized();
    ExpectFrame(ContactFrame(normal), normal, 1e-12);
  }
}

TEST(ContactFrame, StaysUsableNearAndAtThePole) {
  const Vector3 pole = Vector3(-6, -10, -15) / 19;
  for (double angle : {0.0, 1e-12, 1e-9, 1e-7, 1e-4}) {
    const Vector3 normal = (pole + angle * pole.unitOrthogonal()).normalized();
    ExpectFrame(ContactFrame(normal), normal, angle > 1e-8 ? 1e-8 : 1e-3);
    EXPECT_TRUE(ContactFrame(normal).allFinite());
  }
}

TEST(ContactFrame, IsContinuousAtFloorsAndWalls) {
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> uniform(-1e-9, 1e-9);
  for (int axis = 0; axis < 3; ++axis) {
    for (double sign : {-1.0, 1.0}) {
      const Vector3 normal = sign * Vector3::Unit(axis);
      for (int trial = 0; trial < 100; ++trial) {
        const Vector3 near = (normal + Vector3(uniform(rng), uniform(rng), uniform(rng))).normalized();
        EXPECT_LE((ContactFrame(near) - ContactFrame(normal)).norm(), 1e-7);
      }
    }
  }
}

TEST(Mixing, RootAndMaximum) {
  EXPECT_DOUBLE_EQ(MixFriction(0.25, 1), 0.5);
  EXPECT_DOUBLE_EQ(MixFriction(0, 1), 0);
  EXPECT_DOUBLE_EQ(MixRestitution(0.2, 0.7), 0.7);
}

TEST(RelativeVelocity, OfBAgainstA) {
  Body a, b;
  a.linear_velocity_W = {0, 0, 1};
  b.position_W = {0, 0, 2};
  b.linear_velocity_W = {0, 0, -2};
  b.angular_velocity_W = {0, 3, 0};
  Contact contact;
  contact.point_W = {0, 0, 1};
  contact.normal_W = Vector3::UnitZ();
  EXPECT_TRUE(RelativeVelocity(contact, a, b).isApprox(Vector3(-3, 0, -3)));
  EXPECT_DOUBLE_EQ(NormalVelocity(contact, a, b), -3);
}

}  // namespace
}  // namespace islet
