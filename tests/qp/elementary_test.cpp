#include "qp/elementary.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Against the library's functions of 64 bits of mantissa.
TEST(Elementary, AreThoseOfTheLibrary) {
  Random random(3);
  for (int i = 0; i < 200000; ++i) {
    const double size = std::pow(10.0, random.Uniform(-12, 5)), x = size * random.Uniform(-1, 1);
    const double y = size * random.Uniform(-1, 1), z = random.Uniform(-1, 1);
    const long double sine = std::sin(static_cast<long double>(x)), cosine = std::cos(static_cast<long double>(x));
    ASSERT_NEAR(Sine(x), static_cast<double>(sine), 4e-16 * std::abs(static_cast<double>(sine))) << x;
    ASSERT_NEAR(Cosine(x), static_cast<double>(cosine), 4e-16 * std::abs(static_cast<double>(cosine))) << x;
    const double arc = static_cast<double>(std::atan(static_cast<long double>(x)));
    const double arc2 = static_cast<double>(std::atan2(static_cast<long double>(y), static_cast<long double>(z)));
    ASSERT_NEAR(ArcTangent(x), arc, 1e-15 * std::abs(arc)) << x;
    ASSERT_NEAR(ArcTangent(y, z), arc2, 1e-15 * std::abs(arc2)) << y << ", " << z;
  }
}

TEST(Elementary, Ends) {
  EXPECT_EQ(Sine(0.0), 0);
  EXPECT_EQ(Cosine(0.0), 1);
  EXPECT_EQ(Sine(-0.3), -Sine(0.3));
  EXPECT_EQ(Cosine(-0.3), Cosine(0.3));
  EXPECT_NEAR(Sine(std::numbers::pi), 1.2246467991473532e-16, 1e-32);  // pi as a number is that much too small
  EXPECT_NEAR(Sine(1e9), std::sin(1e9), 1e-7);
  EXPECT_TRUE(std::isnan(Sine(kInfinity)) && std::isnan(Cosine(NAN)) && std::isnan(ArcTangent(NAN)));
  EXPECT_EQ(ArcTangent(kInfinity), std::numbers::pi / 2);
  EXPECT_NEAR(ArcTangent(-1.0), -std::numbers::pi / 4, 2e-16);
  EXPECT_EQ(ArcTangent(0.0, 0.0), 0);
  EXPECT_EQ(ArcTangent(0.0, -2.0), std::numbers::pi);
  EXPECT_EQ(ArcTangent(2.0, 0.0), std::numbers::pi / 2);
  EXPECT_NEAR(ArcTangent(-1.0, -1.0), -0.75 * std::numbers::pi, 1e-15);
}

// The number is that of an EPYC with wide vectors and of the same without fused multiply-add: any other machine must have it.
TEST(Elementary, BitsOfEveryMachine) {
  std::uint64_t hash = 0;
  for (int i = -20000; i < 20000; ++i)
    for (const double value : {Sine(1e-3 * i), Cosine(1e-3 * i), ArcTangent(1e-3 * i), ArcTangent(1e-3 * i, 0.7)})
      hash = hash * 1099511628211u + std::bit_cast<std::uint64_t>(value);
  EXPECT_EQ(hash, 5631214665786789024u);
}

}  // namespace
}  // namespace islet::testing
