// Steps made by hand, whose error is known: one cube on a floor or a slope.
#include "bench/charts/coulomb_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;
using peers::WorldPlan;

constexpr double kDt = 1.0 / 60;  // [s]
constexpr double kG = 9.81;       // [m/s^2]
constexpr double kFitted = 2e-5;  // what the fit reaches

WorldPlan CubeOnFloor(double friction = 0.5) {
  WorldPlan plan{.friction = friction, .bodies = {{.half_extents = {10, 10, 1}, .mass = 0}, {}}};
  plan.bodies[0].start.position_W = {0, 0, -1};
  plan.bodies[1].start.position_W = {0, 0, 0.5};
  return plan;
}

// The same, all of it turned about y.
WorldPlan CubeOnSlope(double angle) {
  WorldPlan plan = CubeOnFloor();
  const Quaternion tilt(Eigen::AngleAxisd(angle, Vector3::UnitY()));
  for (BodyPlan& body : plan.bodies) {
    body.start.rotation_WB = tilt;
    body.start.position_W = tilt * body.start.position_W;
  }
  return plan;
}

// The cube's velocity goes from `from` to `to` while it is where the plan has it.
double ErrorOf(const WorldPlan& plan, const Vector3& from, const Vector3& to, double dt = kDt) {
  std::vector<State> before, after;
  for (const BodyPlan& body : plan.bodies) before.push_back(body.start);
  before[1].linear_velocity_W = from;
  after = before;
  after[1].linear_velocity_W = to;
  after[1].position_W += dt * to;
  return CoulombMeter(plan).Measure(before, after, dt).error;
}

TEST(CoulombError, RestOnAFloor) { EXPECT_LT(ErrorOf(CubeOnFloor(), {0, 0, 0}, {0, 0, 0}), kFitted); }

TEST(CoulombError, FreeFlightHasNone) {
  WorldPlan plan = CubeOnFloor();
  plan.bodies[1].start.position_W.z() = 5;
  EXPECT_LT(ErrorOf(plan, {1, 2, 3}, {1, 2, 3 - kG * kDt}), 1e-12);
}

TEST(CoulombError, RestInTheAirIsAllError) {
  WorldPlan plan = CubeOnFloor();
  plan.bodies[1].start.position_W.z() = 0.6;
  EXPECT_NEAR(ErrorOf(plan, {0, 0, 0}, {0, 0, 0}), 1, 1e-12);
}

TEST(CoulombError, FallingThroughTheFloorIsAllError) {
  EXPECT_NEAR(ErrorOf(CubeOnFloor(), {0, 0, 0}, {0, 0, -kG * kDt}), 1, 1e-12);
}

TEST(CoulombError, SlidingWithTheRightFriction) {
  EXPECT_LT(ErrorOf(CubeOnFloor(), {3, 4, 0}, Vector3(3, 4, 0) * (1 - 0.5 * kG * kDt / 5)), kFitted);
}

// The impulse that comes closest lies on the cone: off by |mu - mu'| / sqrt(1 + mu^2).
TEST(CoulombError, SlidingWithHalfTheFriction) {
  EXPECT_NEAR(ErrorOf(CubeOnFloor(), {5, 0, 0}, {5 - 0.25 * kG * kDt, 0, 0}), 0.25 / std::sqrt(1.25), 1e-3);
}

TEST(CoulombError, SlidingWithTooMuchFriction) {
  EXPECT_NEAR(ErrorOf(CubeOnFloor(), {5, 0, 0}, {5 - 0.75 * kG * kDt, 0, 0}), 0.25 / std::sqrt(1.25), 1e-3);
}

TEST(CoulombError, FrictionAcrossTheSlip) {
  EXPECT_GT(ErrorOf(CubeOnFloor(), {5, 0, 0}, {5, -0.5 * kG * kDt, 0}), 0.4);
}

// Creep on a slope, where friction should have held: the velocity is what is wrong, the same for any step.
TEST(CoulombError, CreepCountsAlikeWithAnyStep) {
  const double angle = 0.9 * std::atan(0.5);
  const Vector3 creep = 0.01 * Vector3(std::cos(angle), 0, -std::sin(angle));
  const double coarse = ErrorOf(CubeOnSlope(angle), creep, creep, 1.0 / 30);
  const double fine = ErrorOf(CubeOnSlope(angle), creep, creep, 1.0 / 960);
  EXPECT_NEAR(coarse, fine, 0.1 * fine);
  EXPECT_GT(fine, 0.02);
  EXPECT_LT(fine, 0.2);
}

TEST(CoulombError, HeldOnASlopeBelowTheAngleOfFriction) {
  EXPECT_LT(ErrorOf(CubeOnSlope(0.99 * std::atan(0.5)), {0, 0, 0}, {0, 0, 0}), kFitted);
}

TEST(CoulombError, HeldOnASlopeThatIsTooSteep) {
  const double angle = std::atan(0.5) + 0.1;
  EXPECT_NEAR(ErrorOf(CubeOnSlope(angle), {0, 0, 0}, {0, 0, 0}), std::sin(0.1), 1e-3);
}

TEST(CoulombError, StickingToTheFloorWhileLeavingIt) {
  EXPECT_GT(ErrorOf(CubeOnFloor(), {0, 0, 0}, {0, 0, 0.5}), 0.5);  // thrown up by the floor
  EXPECT_GT(ErrorOf(CubeOnFloor(), {0, 0, 1}, {0, 0, 0}), 0.9);    // held back by it
}

TEST(CoulombError, AGapMayBeUsedUp) {
  WorldPlan plan = CubeOnFloor();
  plan.bodies[1].start.position_W.z() += 1e-3;
  EXPECT_LT(ErrorOf(plan, {0, 0, 0}, {0, 0, -0.9e-3 / kDt}), kFitted);
  EXPECT_LT(ErrorOf(plan, {0, 0, -1}, {0, 0, -1 - kG * kDt}), 1e-12);  // even if it closes within the step
  EXPECT_GT(ErrorOf(plan, {0, 0, 0.2}, {0, 0, 0.2}), 0.5);             // but it holds nothing up that leaves
}

TEST(CoulombError, ABounceMayKeepItsShareOfTheSpeed) {
  WorldPlan plan = CubeOnFloor();
  EXPECT_GT(ErrorOf(plan, {0, 0, -0.1}, {0, 0, 0.05}), 0.2);
  plan.restitution = 0.5;
  EXPECT_LT(ErrorOf(plan, {0, 0, -0.1}, {0, 0, 0.05}), kFitted);
  EXPECT_GT(ErrorOf(plan, {0, 0, -0.1}, {0, 0, 0.1}), 0.2);
}

// A cube on another one, on another one, which is on the floor; a fourth one far away floats, which is all error.
TEST(CoulombError, BodiesThatCollideAreNotJudged) {
  WorldPlan plan = CubeOnFloor();
  plan.bodies.resize(5);
  plan.bodies[2].start.position_W = {0, 0, 1.5};
  plan.bodies[3].start.position_W = {0, 0, 2.5};
  plan.bodies[4].start.position_W = {5, 0, 4};
  std::vector<State> before;
  for (const BodyPlan& body : plan.bodies) before.push_back(body.start);
  const CoulombError at_rest = CoulombMeter(plan).Measure(before, before, kDt);
  EXPECT_EQ(at_rest.judged, 4);
  EXPECT_NEAR(at_rest.error, 1.0 / 4, 1e-4);
  std::vector<State> after = before;
  before[3].linear_velocity_W.z() = -1;  // the blow goes through the two below it into the floor
  const CoulombError collision = CoulombMeter(plan).Measure(before, after, kDt);
  EXPECT_EQ(collision.judged, 2);
  EXPECT_EQ(collision.candidates, 4);
  EXPECT_NEAR(collision.error, 1.0 / 2, 1e-3);
}

TEST(CoulombError, ATowerAtRestIsExplained) {
  WorldPlan plan = CubeOnFloor();
  for (int i = 1; i < 10; ++i) {
    plan.bodies.push_back(plan.bodies[1]);
    plan.bodies.back().start.position_W.z() += i;
  }
  EXPECT_LT(ErrorOf(plan, {0, 0, 0}, {0, 0, 0}), 1e-4);
}

// Faces that fit but for rounding touch at their corners, not wherever rounding lets their sides cross.
TEST(CoulombError, ATowerThatTremblesByRoundingIsExplained) {
  WorldPlan plan = CubeOnFloor();
  for (int i = 1; i < 10; ++i) {
    plan.bodies.push_back(plan.bodies[1]);
    plan.bodies.back().start.position_W.z() += i;
  }
  CoulombMeter meter(plan);
  for (int step = 0; step < 5; ++step) {
    std::vector<State> states;
    for (const BodyPlan& body : plan.bodies) states.push_back(body.start);
    for (int i = 1; i <= 10; ++i) {
      const double tremor = 1e-11 * std::sin(7 * step + 3 * i);
      states[i].position_W += tremor * Vector3(1, -1, 0);
      states[i].rotation_WB = Quaternion(Eigen::AngleAxisd(tremor, Vector3(1, 2, 3).normalized()));
    }
    const CoulombError error = meter.Measure(states, states, kDt);
    EXPECT_EQ(error.contacts, 40);
    EXPECT_LT(error.error, kFitted);
  }
}

TEST(CoulombError, APushIsNoContact) {
  WorldPlan plan = CubeOnFloor();
  plan.bodies[1].push_W = {0, 0, kG};
  EXPECT_LT(ErrorOf(plan, {1, 0, 0}, {1, 0, 0}), kFitted);
}

TEST(CoulombError, NeedsGravity) {
  WorldPlan plan = CubeOnFloor();
  plan.gravity = Vector3::Zero();
  EXPECT_THROW(CoulombMeter{plan}, std::invalid_argument);
}

}  // namespace
}  // namespace islet::charts
