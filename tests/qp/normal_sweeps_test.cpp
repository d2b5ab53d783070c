#include "qp/normal_sweeps.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "qp/interior_point.h"
#include "qp/natural_map.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

Problem WithoutFriction(Problem problem) {
  for (ContactTerm& contact : problem.contacts) contact.friction = 0;
  return problem;
}

// Two balls on each other on the ground: no lever arms.
Problem Column() {
  ProblemBuilder builder;
  for (int i = 0; i < 2; ++i) {
    builder.AddBody(Vector3(0, 0, i + 0.5), 1 + i, 0.1 * Matrix3::Identity(),
                    (Vector6() << 0, 0, -1, 3, 0, 0).finished());
    builder.AddContact(i - 1, i, Vector3(0, 0, i), Vector3::UnitZ(), 0);
  }
  return builder.problem;
}

TEST(NormalSweeps, ColumnOfBalls) {
  const Problem problem = Column();
  std::vector<Vector3> impulses(2, Vector3::Zero());
  std::vector<double> velocities = FreeVelocities(problem);
  qp::NormalSweeps sweeps;
  EXPECT_LT(sweeps.Sweep(problem, 500, 1e-14, &impulses, &velocities), 500);
  EXPECT_NEAR(impulses[0][0], 3, 1e-12);  // all the momentum
  EXPECT_NEAR(impulses[1][0], 2, 1e-12);
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(velocities[6 * i + 2], 0, 1e-12);
    EXPECT_EQ(velocities[6 * i + 3], 3);  // spins on
  }
}

TEST(NormalSweeps, KeepTheMomentumAndComeNearTheLaw) {
  Random random(21);
  qp::NormalSweeps sweeps;
  for (int trial = 0; trial < 20; ++trial) {
    const Problem problem =
        WithoutFriction(trial % 2 == 0 ? RandomStack(&random, 4, 0, 0, 10) : RandomCluster(&random, 12, 0, 0, 10));
    std::vector<Vector3> impulses(problem.contacts.size(), Vector3::Zero());
    std::vector<double> velocities = FreeVelocities(problem);
    const double before = qp::CoulombMap(problem, velocities, impulses).rms;
    for (int round = 0; round < 2; ++round) {  // goes on from where it was
      sweeps.Sweep(problem, 200, 0, &impulses, &velocities);
      EXPECT_LT(MomentumResidual(problem, velocities, impulses), 1e-11 * VelocityScale(problem)) << trial;
    }
    for (const Vector3& j : impulses) EXPECT_TRUE(j[0] >= 0 && j[1] == 0 && j[2] == 0) << trial;
    EXPECT_LT(qp::CoulombMap(problem, velocities, impulses).rms, 1e-3 * before + 1e-12) << trial;
  }
}

TEST(NormalSweeps, RepeatedSweepsAllocateNothing) {
  Random random(22);
  const Problem problem = WithoutFriction(RandomStack(&random, 6, 0, 0, 10));
  std::vector<Vector3> impulses(problem.contacts.size(), Vector3::Zero());
  std::vector<double> velocities = FreeVelocities(problem);
  qp::NormalSweeps sweeps;
  sweeps.Sweep(problem, 10, 0, &impulses, &velocities);
  const AllocationCounter counter;
  sweeps.Sweep(problem, 10, 0, &impulses, &velocities);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
