#include "qp/drift.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "qp/body_algebra.h"
#include "qp/natural_map.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

constexpr double kAngle = 0.02;  // [rad] between two walls that hold one ball: a sweep gains a factor of cos^2

// A unit mass that falls at 1 m/s on two walls whose normals nearly agree, and goes sideways at `aside` [m/s].
Problem BallOnTwoWalls(double aside) {
  ProblemBuilder builder;
  Vector6 velocity;
  velocity << aside, 0, -1, 0, 0, 0;
  builder.AddBody({0, 0, 0}, 1, Matrix3::Identity(), velocity);
  builder.AddContact(-1, 0, {0, 0, 0}, {0, 0, 1}, 0);
  builder.AddContact(-1, 0, {0, 0, 0}, {std::sin(kAngle), 0, std::cos(kAngle)}, 0);
  return builder.problem;
}

struct Sweeper {
  explicit Sweeper(const Problem& p) : problem(p), impulses(p.contacts.size(), Vector3::Zero()) {
    qp::ImpulseScales(problem, &scales);
    velocities = FreeVelocities(problem);
    sweeps.Prepare(problem);
  }
  void Sweep(int most, qp::Pace pace = qp::Pace::kPlain) {
    sweeps.Sweep(problem, most, 0, &impulses, &velocities, pace);
  }
  bool Follow(double least) { return drift.Follow(problem, scales, least, &sweeps, &impulses, &velocities); }

  const Problem& problem;
  std::vector<Vector3> impulses;
  std::vector<double> scales, velocities;
  qp::GaussSeidel sweeps;
  qp::Drift drift;
};

// vz = 0 and vx sin a + vz cos a = 0, so v = 0: the second wall gives 0.01 = j sin a, the first what is left of 1 kg m/s.
TEST(Drift, GeometricSeriesIsSummed) {
  const Problem problem = BallOnTwoWalls(-0.01);
  const double second = 0.01 / std::sin(kAngle), first = 1 - second * std::cos(kAngle);
  Sweeper sweeper(problem);
  sweeper.Sweep(100);
  EXPECT_GT(std::abs(sweeper.impulses[0][0] - first), 0.4);
  EXPECT_TRUE(sweeper.Follow(1e-9));
  EXPECT_NEAR(sweeper.impulses[0][0], first, 1e-9);
  EXPECT_NEAR(sweeper.impulses[1][0], second, 1e-9);
  EXPECT_NEAR(sweeper.velocities[0], 0, 1e-11);
  EXPECT_NEAR(sweeper.velocities[2], 0, 1e-9);
}

// Going away from the second wall, the ball leans on the first alone. Impulse that begins at the second wanders over by
// 2e-5 kg m/s a sweep, and so does not get there in 100 sweeps.
TEST(Drift, SteadyChangeGoesToWhereAContactOpens) {
  const Problem problem = BallOnTwoWalls(0.001);
  Sweeper sweeper(problem);
  sweeper.impulses[1][0] = 0.5;
  qp::VelocitiesAfter(problem, sweeper.impulses, &sweeper.velocities);
  sweeper.Sweep(10);
  EXPECT_GT(sweeper.impulses[1][0], 0.2);
  EXPECT_TRUE(sweeper.Follow(1e-9));
  sweeper.Sweep(2);
  EXPECT_NEAR(sweeper.impulses[0][0], 1, 1e-12);
  EXPECT_EQ(sweeper.impulses[1][0], 0);
  EXPECT_NEAR(sweeper.velocities[0], 0.001, 1e-12);
}

TEST(Drift, StaysInTheConesAndKeepsMomentum) {
  Random random(401);
  int followed = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Problem problem = RandomCluster(&random, 20, 0.2, 0.8, 5);
    Sweeper sweeper(problem);
    for (int round = 0; round < 5; ++round) {
      sweeper.Sweep(20);
      followed += sweeper.Follow(1e-9);
      EXPECT_LT(MomentumResidual(problem, sweeper.velocities, sweeper.impulses), 1e-12);
      for (size_t c = 0; c < problem.contacts.size(); ++c) {
        const Vector3& j = sweeper.impulses[c];
        EXPECT_GE(j[0], 0);
        EXPECT_LE(j.tail<2>().norm(), problem.contacts[c].friction * j[0] * (1 + 1e-12));
      }
    }
  }
  EXPECT_GT(followed, 50);
}

// What is left after the same number of sweeps: log10 of the natural map over the velocity scale, mean of 20 towers.
TEST(Drift, HastensTowers) {
  Random random(402);
  double plain = 0, followed = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Problem problem = RandomStack(&random, 6, 0.3, 0.6, 3);
    Sweeper a(problem), b(problem);
    for (int round = 0; round < 8; ++round) {
      a.Sweep(52);
      b.Sweep(50);
      b.Follow(1e-12);
    }
    a.Sweep(50);
    b.Sweep(50);
    const auto digits = [&](const Sweeper& s) {
      const double map = qp::CoulombMap(problem, s.velocities, s.impulses).rms;
      return std::log10(std::max(1e-12, map / VelocityScale(problem)));
    };
    plain += digits(a) / 20;
    followed += digits(b) / 20;
  }
  EXPECT_LT(followed, plain - 1);
}

TEST(Drift, NothingDriftsAtTheAnswer) {
  const Problem problem = BallOnTwoWalls(0.001);
  Sweeper sweeper(problem);
  sweeper.Sweep(10);
  const std::vector<Vector3> before = sweeper.impulses;
  EXPECT_FALSE(sweeper.Follow(1e-9));
  for (size_t c = 0; c < before.size(); ++c) EXPECT_EQ(before[c], sweeper.impulses[c]);
}

TEST(Drift, AllocatesNothingTheSecondTime) {
  Random random(403);
  const Problem problem = RandomCluster(&random, 30, 0.3, 0.6, 2);
  Sweeper sweeper(problem);
  sweeper.Sweep(20);
  sweeper.Follow(1e-9);
  sweeper.Sweep(20);
  const AllocationCounter counter;
  sweeper.Follow(1e-9);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
