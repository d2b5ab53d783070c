#include "engine/earlier_overlaps.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/no_alloc.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Turn;

const std::vector<double> kTolerances(3, 1e-3);

// Surfaces 0.1 m inside each other along x, at the points (0.55, 0, 0) of body 0 and (0.45, 0, 0) of body 1.
const Contact kDeep{
    .body_a = 0, .body_b = 1, .point_W = {0.5, 0, 0}, .normal_W = Vector3::UnitX(), .gap = -0.1, .feature = 7};

std::vector<Body> Bodies() {
  std::vector<Body> bodies(3);
  bodies[1].position_W = {1, 0, 0};
  bodies[2].position_W = {0, 5, 0};
  return bodies;
}

TEST(EarlierOverlaps, FollowThePointsThatMet) {
  std::vector<Body> bodies = Bodies();
  EarlierOverlaps earlier;
  earlier.Keep(std::vector<Contact>{kDeep}, kTolerances, bodies);
  bodies[0].position_W.x() -= 0.03;
  bodies[1].position_W += Vector3(0.04, 0.2, 0);
  const std::vector<Contact> with = earlier.With({}, bodies);
  ASSERT_EQ(with.size(), 1u);
  EXPECT_NEAR(with[0].gap, -0.03, 1e-15);  // along the normal of then
  EXPECT_NEAR((with[0].point_W - Vector3(0.505, 0.1, 0)).norm(), 0, 1e-15);
  bodies[1].position_W.x() -= 0.2;
  EXPECT_NEAR(earlier.With({}, bodies)[0].gap, -0.1, 1e-15);  // no deeper than it was

  // A turn of body 1 about its centre takes its point at (-0.55, 0, 0) from there by 0.55 (1 - cos).
  bodies = Bodies();
  bodies[1].rotation_WB = Turn(0.3, Vector3::UnitZ());
  EXPECT_NEAR(earlier.With({}, bodies)[0].gap, -0.1 + 0.55 * (1 - std::cos(0.3)), 1e-15);
}

TEST(EarlierOverlaps, OnlyThoseThatOverlapAndAreNotFoundAnyMore) {
  const std::vector<Body> bodies = Bodies();
  Contact slight = kDeep, other = kDeep, open = kDeep;
  slight.gap = -0.5e-3, slight.feature = 8;
  other.body_a = 1, other.body_b = 2;
  open.gap = 0.2;
  EarlierOverlaps earlier;
  earlier.Keep(std::vector<Contact>{kDeep, slight, other}, kTolerances, bodies);
  EXPECT_EQ(earlier.With({}, bodies).size(), 2u);
  const std::vector<Contact> with = earlier.With(std::vector<Contact>{open}, bodies);  // kDeep's feature, now open
  ASSERT_EQ(with.size(), 2u);
  EXPECT_EQ(with[0].gap, 0.2);
  EXPECT_EQ(with[1].body_b, 2);
  EXPECT_EQ(earlier.With({}, bodies).size(), 1u);  // opened, and so forgotten
  Contact behind = other;
  behind.normal_W = -Vector3::UnitX(), behind.feature = 9;
  EXPECT_EQ(earlier.With(std::vector<Contact>{behind}, bodies).size(), 1u);
  EXPECT_TRUE(earlier.With({}, bodies).empty());
  earlier.Keep(std::vector<Contact>{kDeep}, kTolerances, bodies);
  earlier.Clear();
  EXPECT_TRUE(earlier.With({}, bodies).empty());
}

// The same feature in two passes: as it was in the later one. No memory after the first step.
TEST(EarlierOverlaps, OnceAFeature) {
  std::vector<Body> bodies = Bodies();
  Contact again = kDeep;
  again.gap = -0.02;
  const std::vector<Contact> first{kDeep}, second{again};
  EarlierOverlaps earlier;
  for (int step = 0; step < 2; ++step) {
    const testing::AllocationCounter counter;
    earlier.Clear();
    earlier.Keep(first, kTolerances, bodies);
    earlier.Keep(second, kTolerances, bodies);
    const std::vector<Contact>& with = earlier.With({}, bodies);
    ASSERT_EQ(with.size(), 1u);
    EXPECT_NEAR(with[0].gap, -0.02, 1e-15);
    if (step > 0) {
      EXPECT_EQ(counter.count(), 0);
    }
  }
}

}  // namespace
}  // namespace islet
