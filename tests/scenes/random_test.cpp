#include "scenes/random.h"

#include <gtest/gtest.h>

#include <cmath>

namespace islet {
namespace {

// The first numbers of the reference implementation for this seed.
TEST(SplitMix64, IsTheReferenceSequence) {
  SplitMix64 random(1234567);
  EXPECT_EQ(random.Next(), 6457827717110365317u);
  EXPECT_EQ(random.Next(), 3203168211198807973u);
  EXPECT_EQ(random.Next(), 9817491932198370423u);
}

TEST(SplitMix64, UniformFillsItsRangeEvenly) {
  SplitMix64 random(1);
  constexpr int kDraws = 40000;
  double sum = 0, lowest = 10, highest = -10;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Uniform(-2, 3);
    sum += x;
    lowest = std::min(lowest, x);
    highest = std::max(highest, x);
  }
  EXPECT_GE(lowest, -2);
  EXPECT_LT(highest, 3);
  EXPECT_NEAR(lowest, -2, 1e-2);
  EXPECT_NEAR(highest, 3, 1e-2);
  EXPECT_NEAR(sum / kDraws, 0.5, 4 * 5 / std::sqrt(12.0 * kDraws));  // four standard errors
}

TEST(SplitMix64, DirectionsAreUnitAndIsotropic) {
  SplitMix64 random(2);
  constexpr int kDraws = 20000;
  Vector3 mean = Vector3::Zero();
  Matrix3 spread = Matrix3::Zero();
  for (int i = 0; i < kDraws; ++i) {
    const Vector3 d = random.Direction();
    ASSERT_NEAR(d.norm(), 1, 1e-14);
    mean += d / kDraws;
    spread += d * d.transpose() / kDraws;
  }
  EXPECT_LT(mean.norm(), 0.03);
  EXPECT_LT((spread - Matrix3::Identity() / 3).norm(), 0.02);
}

TEST(SplitMix64, RotationsStayBelowTheLargestAngle) {
  SplitMix64 random(3);
  double largest = 0;
  for (int i = 0; i < 1000; ++i) {
    const Quaternion q = random.Rotation(0.3);
    ASSERT_NEAR(q.norm(), 1, 1e-14);
    largest = std::max(largest, 2 * std::atan2(q.vec().norm(), std::abs(q.w())));
  }
  EXPECT_LE(largest, 0.3 + 1e-12);
  EXPECT_GT(largest, 0.29);
}

}  // namespace
}  // namespace islet
