// Whole runs whose answer is known, made by formula and not by an engine, as an engine of each kind would report them.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "bench/charts/coulomb_error.h"
#include "bench/charts/judge.h"

namespace islet::charts {
namespace {

using peers::State;
using peers::WorldPlan;

constexpr double kG = 9.81;             // [m/s^2]
constexpr double kUnit = kG / 60;       // [m/s] a velocity that counts as 1
constexpr double kFitted = 2e-5;        // what the fit reaches
constexpr double kRates[] = {30, 480};  // [1/s]

WorldPlan CubeOnFloor() {
  WorldPlan plan{.friction = 0.5, .bodies = {{.half_extents = {50, 50, 10}, .mass = 0}, {}}};
  plan.bodies[0].start.position_W = {0, 0, -10};
  plan.bodies[1].start.position_W = {0, 0, 0.5};
  return plan;
}

struct Moment {
  Vector3 position, velocity;
};

// The mean error of the cube over a run of a second, and the share of its contact that was judged.
struct Verdict {
  double error = 0, worst = 0, displacement = 0, judged = 0;
};

Verdict Judged(const WorldPlan& plan, double rate, const std::function<Moment(double)>& at) {
  CoulombMeter meter(plan);
  std::vector<State> before, after;
  for (const peers::BodyPlan& body : plan.bodies) before.push_back(body.start);
  after = before;
  Verdict verdict;
  int judged = 0, candidates = 0;
  for (int step = 0; step < static_cast<int>(rate); ++step) {
    const Moment from = at(step / rate), to = at((step + 1) / rate);
    before[1].position_W = from.position, before[1].linear_velocity_W = from.velocity;
    after[1].position_W = to.position, after[1].linear_velocity_W = to.velocity;
    const CoulombError error = meter.Measure(before, after, 1 / rate);
    judged += error.judged, candidates += error.candidates;
    verdict.error += error.judged * error.error;
    verdict.displacement = std::max(verdict.displacement, error.displacement);
    if (error.judged > 0) verdict.worst = std::max(verdict.worst, error.error);
  }
  verdict.error /= std::max(1, judged);
  verdict.judged = static_cast<double>(judged) / std::max(1, candidates);
  return verdict;
}

TEST(CoulombRuns, AnExactSlideUntilItStops) {
  for (const double rate : kRates) {
    const double stop = 20 / rate;  // [s] at the end of a step
    const auto exact = [&](double t) {
      const double left = std::max(0.0, stop - t), deceleration = 0.5 * kG;
      return Moment{{-0.5 * deceleration * left * left, 0, 0.5}, {deceleration * left, 0, 0}};
    };
    const Verdict verdict = Judged(CubeOnFloor(), rate, exact);
    EXPECT_LT(verdict.worst, kFitted) << rate;
    EXPECT_EQ(verdict.judged, 1) << rate;
  }
}

// The positions of the semi-implicit rule, which most engines use, are told by the velocity after the step.
TEST(CoulombRuns, EitherRuleForPositionsWillDo) {
  const double rate = 60, change = 0.5 * kG / rate;  // [m/s]
  const auto semi_implicit = [&](double t) {
    const double n = std::round(t * rate);  // x = sum of v / rate over the steps after each
    return Moment{{(5 * n - 0.5 * change * n * (n + 1)) / rate, 0, 0.5}, {5 - change * n, 0, 0}};
  };
  EXPECT_LT(Judged(CubeOnFloor(), rate, semi_implicit).worst, kFitted);
}

TEST(CoulombRuns, SinkingCountsMoreIfNoVelocityTellsIt) {
  for (const double rate : kRates) {
    const double sinking = 0.01;  // [m/s]
    const auto at = [&](double t) { return Vector3(0, 0, 0.5 - 1e-3 - sinking * t); };
    const Verdict told = Judged(CubeOnFloor(), rate, [&](double t) { return Moment{at(t), {0, 0, -sinking}}; });
    const Verdict untold = Judged(CubeOnFloor(), rate, [&](double t) { return Moment{at(t), {0, 0, 0}}; });
    EXPECT_NEAR(told.error, sinking / kUnit, 0.02 * sinking / kUnit) << rate;
    EXPECT_NEAR(untold.error, std::sqrt(2) * sinking / kUnit, 0.02 * sinking / kUnit) << rate;
  }
}

// A cube that overlaps is pushed out: by velocity, as by ERP, or by moving it while its velocity is zero.
TEST(CoulombRuns, PushingOutCountsAlikeWhetherVelocityTellsIt) {
  for (const double rate : kRates) {
    const double rising = 0.01;  // [m/s]
    const auto at = [&](double t) { return Vector3(0, 0, 0.5 - 0.02 + rising * t); };
    const Verdict told = Judged(CubeOnFloor(), rate, [&](double t) { return Moment{at(t), {0, 0, rising}}; });
    const Verdict untold = Judged(CubeOnFloor(), rate, [&](double t) { return Moment{at(t), {0, 0, 0}}; });
    EXPECT_NEAR(told.error, std::sqrt(2) * rising / kUnit, 0.02 * rising / kUnit) << rate;
    EXPECT_NEAR(told.error, untold.error, 0.02 * untold.error) << rate;
  }
}

TEST(CoulombRuns, CreepInThePosesAlone) {
  const double creep = 0.01;  // [m/s]
  const Verdict verdict = Judged(CubeOnFloor(), 60, [&](double t) { return Moment{{creep * t, 0, 0.5}, {0, 0, 0}}; });
  EXPECT_NEAR(verdict.error, std::sqrt(2) * creep / kUnit, 0.02 * creep / kUnit);
}

// The cube turns by that in a step of which its velocities, `spin` before and after, tell what they tell.
double DisplacementOf(const Quaternion& turn, const Vector3& spin, double dt) {
  const WorldPlan plan = CubeOnFloor();
  std::vector<State> before{plan.bodies[0].start, plan.bodies[1].start};
  before[1].angular_velocity_W = spin;
  std::vector<State> after = before;
  after[1].rotation_WB = turn * before[1].rotation_WB;
  return CoulombMeter(plan).Measure(before, after, dt).displacement;
}

TEST(CoulombRuns, RotationInThePosesAlone) {
  const double rate = 0.02, dt = 1.0 / 30;  // [rad/s, s]
  const Quaternion turn(Eigen::AngleAxisd(rate * dt, Vector3::UnitX()));
  EXPECT_NEAR(DisplacementOf(turn, {0, 0, 0}, dt), std::sqrt(2.0 / 6) * rate / kUnit, 1e-4);
  EXPECT_LT(DisplacementOf(turn, {rate, 0, 0}, dt), 1e-9);
}

// q + dt w q / 2, normalised, turns by 2 atan(w dt / 2): fast rotations a little too slowly.
TEST(CoulombRuns, ARuleOfFirstOrderForRotationsIsFree) {
  const double spin = 7, dt = 1.0 / 60;  // [rad/s, s]
  const Quaternion turn(Eigen::AngleAxisd(2 * std::atan(0.5 * spin * dt), Vector3::UnitZ()));
  EXPECT_LT(DisplacementOf(turn, {0, 0, spin}, dt), 1e-12);
}

// What rounding to float makes of a pose is no motion, however short the step.
TEST(CoulombRuns, RoundingToFloatIsFree) {
  const double next = std::nextafter(5.0F, 6.0F);  // [m]
  const auto rounded = [&](double t) { return Moment{{std::lround(960 * t) % 2 == 0 ? 5 : next, 0, 0.5}, {0, 0, 0}}; };
  EXPECT_LT(Judged(CubeOnFloor(), 960, rounded).displacement, 1e-9);
}

// A push of 0.8 of the weight along the floor: friction holds back 0.5, so a cube that stays where it is lacks 0.3.
TEST(CoulombRuns, StickingWhereItShouldSlide) {
  WorldPlan plan = CubeOnFloor();
  plan.bodies[1].push_W = {0.8 * kG, 0, 0};
  const Verdict sticks = Judged(plan, 60, [](double) { return Moment{{0, 0, 0.5}, {0, 0, 0}}; });
  EXPECT_NEAR(sticks.error, 0.3 / std::sqrt(1.25), 1e-3);
  const double gained = 0.3 * kG;  // [m/s^2]
  const auto slides = [&](double t) { return Moment{{0.5 * gained * t * t, 0, 0.5}, {gained * t, 0, 0}}; };
  EXPECT_LT(Judged(plan, 60, slides).worst, kFitted);
}

TEST(CoulombRuns, SlidingWhereItShouldStick) {
  WorldPlan plan = CubeOnFloor();
  plan.bodies[1].push_W = {0.4 * kG, 0, 0};
  const auto slides = [&](double t) { return Moment{{0.2 * kG * t * t, 0, 0.5}, {0.4 * kG * t, 0, 0}}; };
  const Verdict verdict = Judged(plan, 60, slides);  // as if there were no friction
  EXPECT_GT(verdict.error, 0.4);
}

// It comes at 6 m/s and bounces at half its speed at once: the step of the impact is not judged, all else is right.
TEST(CoulombRuns, ABounceIsLeftToTheLawOfImpact) {
  WorldPlan plan = CubeOnFloor();
  plan.restitution = 0.5;
  for (const double rate : kRates) {
    const double impact = 0.5, speed = 6;  // [s, m/s]
    const auto bounces = [&](double t) {
      const double after = t - impact, up = after < -1e-9 ? -speed : 0.5 * speed;
      return Moment{{0, 0, 0.5 + up * after - 0.5 * kG * after * after}, {0, 0, up - kG * after}};
    };
    const Verdict verdict = Judged(plan, rate, bounces);
    EXPECT_LT(verdict.worst, 2e-4) << rate;
    EXPECT_LT(verdict.judged, 1) << rate;
  }
}

// It lands slower than what counts as a collision, in the midst of a step, and stays: judged, and right.
TEST(CoulombRuns, ASoftLandingWithinAStep) {
  const double rate = 30, height = 0.3 * kG / (rate * rate);
  const auto lands = [&](double t) { return Moment{{0, 0, 0.5 + (t < 0.5 / rate ? height : 0)}, {0, 0, 0}}; };
  const Verdict verdict = Judged(CubeOnFloor(), rate, lands);
  EXPECT_LT(verdict.worst, 1e-3);
  EXPECT_EQ(verdict.judged, 1);
}

// A floor that is not there: the step in which it arrives may be a collision, falling on through the floor is none.
TEST(CoulombRuns, AWorldWithoutContactsIsAllError) {
  for (const double rate : kRates) {
    const auto falls = [&](double t) { return Moment{{0, 0, 0.6 - 2 * t - 0.5 * kG * t * t}, {0, 0, -2 - kG * t}}; };
    const Verdict verdict = Judged(CubeOnFloor(), rate, falls);
    EXPECT_GT(verdict.judged, 0.8) << rate;
    EXPECT_GT(verdict.error, 0.99) << rate;
  }
}

// The judge tells what share it judged.
TEST(CoulombRuns, TheJudgeTellsTheShareOfCollisions) {
  const WorldPlan plan = CubeOnFloor();
  Judge judge(plan);
  std::vector<State> rest{plan.bodies[0].start, plan.bodies[1].start}, hit = rest;
  hit[1].linear_velocity_W.z() = -1;
  judge.Sample(0, rest);
  for (int i = 1; i <= 4; ++i) {
    judge.SampleStep(i / 30.0, i == 1 ? hit : rest, rest, 1.0 / 60);
    judge.Sample(i / 30.0, rest);
  }
  EXPECT_DOUBLE_EQ(judge.Result().coulomb_judged, 0.75);
  EXPECT_LT(judge.Result().coulomb_error, kFitted);
  std::vector<State> moved = rest;
  moved[1].position_W.x() += 0.1 * kUnit / 60;
  judge.SampleStep(5 / 30.0, rest, moved, 1.0 / 60);
  EXPECT_NEAR(judge.Result().coulomb_error, 0.1 * std::sqrt(2) / 4, 1e-3);
  EXPECT_LT(judge.Result().coulomb_told, kFitted);
}

}  // namespace
}  // namespace islet::charts
