// The ledgers of a run made by hand, and what counts as failed in each kind of scene.
#include "bench/charts/judge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "bench/charts/chart_plans.h"
#include "bench/charts/chart_scenes.h"

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;
using peers::WorldPlan;

constexpr double kExact = 1e-9;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::vector<State> StartOf(const WorldPlan& plan) {
  std::vector<State> states;
  for (const BodyPlan& body : plan.bodies) states.push_back(body.start);
  return states;
}

WorldPlan TwoBalls() {
  WorldPlan plan{.gravity = Vector3::Zero(),
                 .bodies = {{.form = BodyPlan::Form::kSphere}, {.form = BodyPlan::Form::kSphere, .mass = 3}}};
  plan.bodies[0].start.linear_velocity_W = {2, 0, 0};
  plan.bodies[1].start.position_W = {5, 0, 0};
  return plan;
}

// What the scene says of a run that ends in these states.
std::string Verdict(std::string_view scene_name, const WorldPlan& plan, const std::vector<State>& end,
                    int lost_until = 1) {
  const ChartScene& scene = *FindChartScene(scene_name);
  Judge judge(plan);
  judge.Sample(0, StartOf(plan));
  for (int i = 1; i <= lost_until; ++i) judge.Sample(i / 30.0, end);
  return std::string(scene.judge(plan, judge.last(), judge.Result()).failed);
}

TEST(Judge, LedgersOfEnergyAndMomentum) {
  const WorldPlan plan = TwoBalls();
  std::vector<State> states = StartOf(plan);
  Judge judge(plan);
  judge.Sample(0, states);
  states[0].linear_velocity_W = {1, 0, 0};  // 0.5 J and 1 N s lost
  states[1].linear_velocity_W = {0, 1, 0};  // 1.5 J and 3 N s won
  judge.Sample(1 / 30.0, states);
  states[1].linear_velocity_W = {0, 0, 0};
  judge.Sample(2 / 30.0, states);
  const Measures m = judge.Result();
  EXPECT_NEAR(m.energy_gain, 0, kExact);  // 2 J, 2 J, 0.5 J: no rise
  EXPECT_NEAR(m.energy_ratio, 0.25, kExact);
  EXPECT_NEAR(m.momentum_error, 1, kExact);
  EXPECT_NEAR(m.kinetic_end, 0.5, kExact);
  EXPECT_EQ(m.coulomb_error, -1);
}

TEST(Judge, EnergyOfSpinAndOfHeight) {
  WorldPlan plan{.bodies = {{.half_extents = {0.5, 1, 1.5}, .mass = 6}}};
  std::vector<State> states = StartOf(plan);
  Judge judge(plan);
  judge.Sample(0, states);
  states[0].rotation_WB = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitY()));
  states[0].angular_velocity_W = {1, 0, 0};  // about the longest axis of the body, z: 6 / 3 (0.25 + 1) = 2.5 kg m^2
  judge.Sample(1 / 30.0, states);
  EXPECT_NEAR(judge.Result().energy_gain, 1.25, kExact);
  states[0].position_W.z() += 0.5;
  judge.Sample(2 / 30.0, states);
  EXPECT_NEAR(judge.Result().energy_gain, 1.25 + 6 * 9.81 * 0.5, kExact);
}

TEST(Judge, MeansOverSamples) {
  const WorldPlan plan = Slide(0);
  std::vector<State> states = StartOf(plan);
  Judge judge(plan);
  judge.Sample(0, states);
  states[1].position_W = {3, 4, 0.4};
  states[1].linear_velocity_W = {2, 0, 0};
  judge.Sample(1 / 30.0, states);
  states[1].position_W = {3, 0, 0.1};
  states[1].linear_velocity_W = {0, 0, 0};
  judge.Sample(2 / 30.0, states);
  const Measures m = judge.Result();
  EXPECT_NEAR(m.overlap_max, 0.4, kExact);
  EXPECT_NEAR(m.overlap_mean, 0.25, kExact);  // of 0.1 and 0.4: not of the first sample
  EXPECT_NEAR(m.drift, std::hypot(3, 0.4), kExact);
  EXPECT_NEAR(m.drift_max, std::hypot(5, 0.1), kExact);
  EXPECT_NEAR(m.creep, std::hypot(4, 0.3), kExact);
  EXPECT_NEAR(m.jitter, std::sqrt(2), kExact);
  EXPECT_NEAR(m.fell_at, 2 / 30.0, kExact);
}

TEST(Judge, LooksAtEachStepOfASmallWorldAndAtFewOfALargeOne) {
  const WorldPlan small = Slide(0), weightless = TwoBalls();
  WorldPlan large{.bodies = std::vector<BodyPlan>(400)};
  for (int i = 0; i < 400; ++i) large.bodies[i].start.position_W = {2.0 * i, 0, 0};
  const WorldPlan elastic = Cloud(1), inelastic = Cloud(0);
  EXPECT_FALSE(Judge(weightless).WantsStep());
  EXPECT_FALSE(Judge(elastic).WantsStep());
  EXPECT_TRUE(Judge(inelastic).WantsStep());
  const std::pair<const WorldPlan*, int> cases[] = {{&small, 30}, {&large, 1}};
  for (const auto& [plan, wanted] : cases) {
    Judge judge(*plan);
    const std::vector<State> states = StartOf(*plan);
    judge.Sample(0, states);
    int count = 0;
    for (int i = 1; i <= 30; ++i) {
      if (judge.WantsStep()) {
        ++count;
        judge.SampleStep(i / 30.0, states, states, 1.0 / 30);
      }
      judge.Sample(i / 30.0, states);
    }
    EXPECT_EQ(count, wanted);
    // At rest in the air, all of them; the one that stands and moves at 5 m/s without slowing down, partly.
    EXPECT_GT(judge.Result().coulomb_error, 0.3);
  }
}

TEST(Judge, HashTellsStatesApart) {
  const WorldPlan plan = TwoBalls();
  std::vector<State> states = StartOf(plan);
  Judge one(plan), other(plan);
  one.Sample(0, states);
  states[1].angular_velocity_W.z() = 1e-300;
  other.Sample(0, states);
  EXPECT_NE(one.StateHash(), other.StateHash());
}

TEST(Verdict, NotFinite) {
  for (const ChartScene& scene : AllChartScenes()) {
    if (scene.few) continue;  // large; the same judges
    const WorldPlan plan = PlanOf(scene, 0);
    std::vector<State> end = StartOf(plan);
    end.back().position_W.x() = kNan;
    EXPECT_EQ(Verdict(scene.name, plan, end), "not finite") << scene.name;
  }
}

TEST(Verdict, StandingAndCollapsed) {
  const WorldPlan plan = PlanOf(*FindChartScene("stack10"), 0);
  std::vector<State> end = StartOf(plan);
  EXPECT_EQ(Verdict("stack10", plan, end), "");
  end.back().position_W.x() += 0.49;
  EXPECT_EQ(Verdict("stack10", plan, end), "");
  end.back().position_W.x() += 0.02;
  EXPECT_EQ(Verdict("stack10", plan, end), "collapsed");
}

TEST(Verdict, LostBodies) {
  const WorldPlan plan = PlanOf(*FindChartScene("cubejam"), 0);
  std::vector<State> end = StartOf(plan);
  EXPECT_EQ(Verdict("cubejam", plan, end), "");
  end.back().position_W.z() = -50;
  EXPECT_EQ(Verdict("cubejam", plan, end), "lost bodies");
}

TEST(Verdict, ATowerThatMustFall) {
  const WorldPlan plan = PlanOf(*FindChartScene("csstack"), 0);
  std::vector<State> end = StartOf(plan);
  EXPECT_EQ(Verdict("csstack", plan, end), "did not fall");
  end.back().position_W.z() -= 0.4;
  EXPECT_EQ(Verdict("csstack", plan, end), "");
}

TEST(Verdict, ARowOfSpheres) {
  const WorldPlan plan = PlanOf(*FindChartScene("cradle_apart"), 0);
  std::vector<State> end = StartOf(plan);
  EXPECT_EQ(Verdict("cradle_apart", plan, end), "not passed on");
  std::swap(end.front().linear_velocity_W, end.back().linear_velocity_W);
  EXPECT_EQ(Verdict("cradle_apart", plan, end), "");
  end.front().position_W = end[1].position_W;
  EXPECT_EQ(Verdict("cradle_apart", plan, end), "passed through");
}

// The closed forms, worked out in numbers.
TEST(Error, OfExactAnswersIsNone) {
  const auto error = [](std::string_view name, const WorldPlan& plan, const std::vector<State>& end) {
    Judge judge(plan);
    judge.Sample(0, StartOf(plan));
    judge.Sample(1 / 30.0, end);
    return FindChartScene(name)->judge(plan, judge.last(), judge.Result()).error;
  };
  const WorldPlan slide = Slide(0), rolling = Rolling(), carrier = Carrier();
  std::vector<State> end = StartOf(slide);
  end[1].position_W.x() = 25 / 9.81;
  EXPECT_NEAR(error("slide0", slide, end), 0, 1e-12);
  end[1].position_W.x() *= 1.1;
  EXPECT_NEAR(error("slide0", slide, end), 0.1, 1e-12);

  end = StartOf(rolling);  // slips for 0.291248 s over 1.248206 m, then at 3.571429 m/s for 2.708752 s
  end[1].position_W += 10.922321 * rolling.bodies[1].start.linear_velocity_W.normalized();
  EXPECT_NEAR(error("rolling", rolling, end), 0, 1e-6);

  end = StartOf(carrier);
  for (size_t i = 1; i < end.size(); ++i) {
    end[i].linear_velocity_W = (i == 1 ? 0.7385 : 0.2110) * 4 * Vector3(1, 1, 0).normalized();
  }
  EXPECT_NEAR(error("carrier", carrier, end), 0, 1e-3);
}

TEST(Starts, DifferByLessThanTheShift) {
  const ChartScene& scene = *FindChartScene("cubejam");
  const WorldPlan first = PlanOf(scene, 0), second = PlanOf(scene, 1), third = PlanOf(scene, 2);
  double most = 0, apart = 0;
  for (size_t i = 0; i < first.bodies.size(); ++i) {
    const Vector3 at = first.bodies[i].start.position_W;
    most = std::max(most, (second.bodies[i].start.position_W - at).lpNorm<Eigen::Infinity>());
    apart = std::max(apart, (second.bodies[i].start.position_W - third.bodies[i].start.position_W).norm());
    if (!first.bodies[i].Moves()) {
      EXPECT_EQ(second.bodies[i].start.position_W, at);
    }
  }
  EXPECT_GT(most, 0);
  EXPECT_LE(most, kShift);
  EXPECT_GT(apart, 0);
}

}  // namespace
}  // namespace islet::charts
