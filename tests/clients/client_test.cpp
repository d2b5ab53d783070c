// An engine with its own solver and with islet's as its solver: the same small scenes, judged alike. One program an engine.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bench/charts/chart_plans.h"
#include "bench/charts/judge.h"
#include "bench/peers/peer.h"

namespace islet::charts {
namespace {

constexpr int kRate = 60;  // steps a second

Measures RunOf(const peers::WorldPlan& plan, const peers::Setting& setting, double seconds) {
  const auto peer = peers::TheEngine().make(plan, setting);
  Judge judge(plan);
  std::vector<peers::State> before(plan.bodies.size()), states(plan.bodies.size());
  const auto read = [&](std::vector<peers::State>* all) {
    for (size_t i = 0; i < all->size(); ++i) (*all)[i] = peer->Read(static_cast<int>(i));
  };
  read(&states);
  judge.Sample(0, states);
  const int steps = static_cast<int>(std::lround(seconds * kRate));
  for (int step = 1; step <= steps; ++step) {
    read(&before);
    peer->Step(setting.dt);
    if (step % (kRate / kSamplesPerSecond) != 0) continue;
    read(&states);
    const double time = step * setting.dt;
    if (judge.WantsStep()) judge.SampleStep(time, before, states, setting.dt);
    judge.Sample(time, states);
  }
  return judge.Result();
}

const peers::Setting kIslet{.solver = "islet", .dt = 1.0 / kRate};

peers::Setting Own() {
  const auto settings = peers::TheEngine().settings;
  peers::Setting own = *std::ranges::find_if(settings, &peers::Setting::is_default);
  own.dt = 1.0 / kRate;
  return own;
}

// (In narrow bins a Coulomb error of 0.01 to 0.07 stays in some heaps: of 24 to 36 boxes in 3 of 13 with rows of two, in 5 with three, in
// none with four. With rows of three Bullet's detector keeps a point with the normal that it was found with, though its body has turned since.
// With rows of two the cause is not known.)
TEST(Client, BinComesToRest) {
  for (const int side : {4, 6}) {
    const peers::WorldPlan plan = Bin(30, side);
    const Measures islet = RunOf(plan, kIslet, 8), own = RunOf(plan, Own(), 8);
    EXPECT_TRUE(islet.finite);
    EXPECT_EQ(islet.lost, 0);
    EXPECT_LT(islet.overlap_max, 0.05);
    EXPECT_LT(islet.overlap_end, 1e-3);
    EXPECT_LT(islet.coulomb_error, 0.1);
    EXPECT_LT(islet.coulomb_end, 1e-4);
    EXPECT_LT(islet.jitter, 1e-2);
    EXPECT_LT(islet.energy_gain, 2e-4);  // of some 200 J: where overlaps are undone
    EXPECT_LE(islet.overlap_mean, own.overlap_mean);
    EXPECT_LE(islet.overlap_max, own.overlap_max);
    EXPECT_LE(islet.coulomb_error, own.coulomb_error);
  }
}

// What begins 5 mm inside of the floor and slides at 2 cm/s has not enough to pay for the way out of it.
TEST(Client, NothingIsLiftedForNothing) {
  peers::WorldPlan plan = Bin(1, 1);
  peers::BodyPlan& box = plan.bodies.back();
  box.start.rotation_WB.setIdentity();
  box.start.position_W = {0, 0, box.half_extents.z() - 5e-3};
  box.start.linear_velocity_W = {0.02, 0, 0};
  const Measures islet = RunOf(plan, kIslet, 1);
  EXPECT_LT(islet.energy_gain, 1e-9);
  EXPECT_LT(islet.overlap_max, 5.001e-3);
}

TEST(Client, CardHouseStands) {
  const Measures islet = RunOf(CardHouse(), kIslet, 2);
  EXPECT_LT(islet.drift_max, 1e-4);
  EXPECT_LT(islet.overlap_max, 1e-6);
  EXPECT_LT(islet.coulomb_error, 1e-4);
}

// Hosts move by the velocity of a step's end, which is half a step off; islet by the mean of both ends.
TEST(Client, FreeFallIsExact) {
  peers::WorldPlan plan = Bin(1, 1);
  plan.bodies.back().start.position_W = {0, 0, 100};
  plan.bodies.back().start.angular_velocity_W = {1, 2, 3};
  EXPECT_NEAR(RunOf(plan, kIslet, 1).drift, 0.5 * kGravity, 1e-9);
}

// Hosts turn bodies by ways of their own, some by no more than an eighth of a turn a step.
TEST(Client, FastSpinIsExact) {
  peers::WorldPlan plan = CradleApart();
  plan.bodies.resize(1);
  plan.bodies[0].start.angular_velocity_W = {0, 0, 100};
  const auto peer = peers::TheEngine().make(plan, kIslet);
  for (int step = 0; step < 30; ++step) peer->Step(kIslet.dt);
  const peers::State end = peer->Read(0);
  EXPECT_LT(end.rotation_WB.angularDistance(Quaternion(Eigen::AngleAxisd(50, Vector3::UnitZ()))), 1e-6);
}

// A row of spheres of which one is passed on: restitution is not lost to finding contacts ahead.
TEST(Client, BouncesAreKept) { EXPECT_NEAR(RunOf(CradleApart(), kIslet, 2).energy_ratio, 1, 1e-9); }

}  // namespace
}  // namespace islet::charts
