#include "qp/newton/proximal.h"

#include <cmath>

#include <gtest/gtest.h>

#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::testing {
namespace {

using qp::Matrix3;
using qp::Vector3;

// By hand: a pull that opens, one that sticks, one that slides.
TEST(Proximal, LawOfAContactOnASpring) {
  const struct {
    double friction;
    Vector3 pull, impulse;
  } cases[] = {{0.5, {-1, 3, 4}, {0, 0, 0}},    {0.5, {0, 3, 4}, {0, 0, 0}}, {0.5, {4, 1, -1}, {4, 1, -1}},
               {0.5, {4, 6, 8}, {4, 1.2, 1.6}}, {0, {2, 0, 0}, {2, 0, 0}},   {0, {2, 1, 0}, {2, 0, 0}}};
  for (const auto& [friction, pull, impulse] : cases)
    EXPECT_LT((qp::CutToCone(pull, friction) - impulse).norm(), 1e-15) << friction << " " << pull.transpose();
}

// Against differences, where the law is smooth; without friction a contact that presses yields along its normal alone.
TEST(Proximal, SlopeIsThatOfTheLaw) {
  for (const Vector3& pull : {Vector3(-1, 3, 4), Vector3(4, 1, -1), Vector3(4, 6, 8), Vector3(1, 0, 2)}) {
    Matrix3 differences;
    for (int k = 0; k < 3; ++k) {
      const Vector3 step = 1e-6 * Vector3::Unit(k);
      differences.col(k) = (qp::CutToCone(pull + step, 0.5) - qp::CutToCone(pull - step, 0.5)) / 2e-6;
    }
    EXPECT_LT((qp::SpringSlope(pull, 0.5) - differences).norm(), 1e-9) << pull.transpose();
  }
  EXPECT_EQ(qp::SpringSlope({2, 0, 0}, 0), Matrix3(Vector3::UnitX().asDiagonal()));
}

// What rests presses, whatever sign rounding gave its pull, and what is beyond that does as it did.
TEST(Proximal, NoSignOfAZeroChoosesASlope) {
  const Matrix3 presses = qp::SpringSlope({1e-14, 3, 4}, 0.5, 1e-9);
  EXPECT_EQ(presses(0, 0), 1);
  EXPECT_EQ(qp::SpringSlope({-1e-14, 3, 4}, 0.5, 1e-9), presses);
  EXPECT_EQ(qp::SpringSlope({-1e-8, 3, 4}, 0.5, 1e-9), Matrix3(Matrix3::Zero()));
  EXPECT_EQ(qp::SpringSlope({4, 6, 8}, 0.5, 1e-9), qp::SpringSlope({4, 6, 8}, 0.5));
}

TEST(Proximal, SpringsAreStifferAfterEasyStepsAndSofterForAWhileAfterOneThatFailed) {
  qp::ProximalPace pace({1, 1});
  const double first = pace.Stiffness(1, 0);
  EXPECT_TRUE(pace.Takes(0.1, true, 1, false));
  EXPECT_DOUBLE_EQ(pace.Stiffness(1, 0), 5 * first);
  EXPECT_TRUE(pace.Takes(0.05, true, 10, false));  // not easy
  EXPECT_DOUBLE_EQ(pace.Stiffness(1, 0), 5 * first);
  EXPECT_FALSE(pace.Takes(1, false, 1, false));
  EXPECT_DOUBLE_EQ(pace.Stiffness(1, 0), first);
  EXPECT_FALSE(pace.Takes(1, false, 1, false));
  EXPECT_DOUBLE_EQ(pace.Stiffness(1, 0), first / 5);
  EXPECT_TRUE(pace.Takes(0.04, true, 1, false));
  EXPECT_DOUBLE_EQ(pace.Stiffness(1, 0), first);
  EXPECT_TRUE(pace.Takes(0.03, true, 10, false));  // not easy
  EXPECT_DOUBLE_EQ(pace.Stiffness(1, 0), first);
  EXPECT_TRUE(pace.Takes(0.02, false, 1, false));  // better, if not solved
  EXPECT_DOUBLE_EQ(pace.Stiffness(1, 0), 5 * first);
}

TEST(Proximal, SpringsHaveBounds) {
  qp::ProximalPace pace({1, 1});
  double map = 1;
  for (int step = 0; step < 10; ++step) pace.Takes(map *= 0.1, true, 1, false);
  EXPECT_DOUBLE_EQ(pace.Stiffness(1, 0), 1e6);
  qp::ProximalPace soft({1, 1});
  int failures = 0;
  while (soft.GoesOn(false)) soft.Takes(1, false, 12, false), ++failures;
  EXPECT_EQ(failures, 7);  // 4e-4
}

// A spring that makes of a velocity's rounding, 1e-15 of it, more than what may be left over is too stiff.
TEST(Proximal, RoundingBoundsTheSprings) {
  qp::ProximalPace pace({1, 1});
  EXPECT_DOUBLE_EQ(pace.Stiffness(2 * kUlp, 1), 2);
  EXPECT_DOUBLE_EQ(pace.Stiffness(2 * kUlp, 1e-3), 2);  // no stiffer at once
}

TEST(Proximal, GivesUpWhatGainsNothing) {
  for (const bool refines : {false, true}) {
    qp::ProximalPace pace({1, 1});
    int steps = 0;
    while (pace.GoesOn(refines) && steps < 100) pace.Takes(refines ? 0.9 : 1.0, true, 1, refines), ++steps;
    EXPECT_EQ(steps, refines ? 5 : 20);
  }
  qp::ProximalPace slow({1, 1});  // a fifth a step is half in four
  double map = 1;
  for (int step = 0; step < 50; ++step) {
    ASSERT_TRUE(slow.GoesOn(true)) << step;
    slow.Takes(map *= 0.8, true, 1, true);
  }
}

}  // namespace
}  // namespace islet::testing
