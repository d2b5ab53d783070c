#include "qp/gauss_seidel.h"

#include <gtest/gtest.h>

#include "qp/island_solver.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

struct Swept {
  std::vector<Vector3> impulses;
  std::vector<double> velocities;
  int sweeps = 0;
};

Swept SweepFromZero(const Problem& problem, int most, double tolerance) {
  qp::GaussSeidel solver;
  Swept swept{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), FreeVelocities(problem), 0};
  solver.Prepare(problem);
  swept.sweeps = solver.Sweep(problem, most, tolerance, &swept.impulses, &swept.velocities);
  return swept;
}

TEST(GaussSeidel, OneContactTakesOneSweepAndOneToNotice) {
  ProblemBuilder builder;
  builder.AddBox({0, 0, 0.5}, {0.5, 0.5, 0.5}, 2, {0.1, 0, -1});
  builder.AddContact(-1, 0, Vector3::Zero(), Vector3::UnitZ(), 0.5);
  const Swept swept = SweepFromZero(builder.problem, 100, 1e-14);
  EXPECT_EQ(swept.sweeps, 2);
  EXPECT_NEAR(swept.impulses[0][0], 2, 1e-14);
  EXPECT_NEAR(swept.velocities[2], 0, 1e-14);
}

TEST(GaussSeidel, KeepsMomentumAndTheCone) {
  for (const NamedProblem& island : RandomIslands(71, 30, 1e3, true)) {
    SCOPED_TRACE(island.name);
    const Swept swept = SweepFromZero(island.problem, 20, 0);
    EXPECT_LT(MomentumResidual(island.problem, swept.velocities, swept.impulses), 1e-10);
    for (size_t c = 0; c < swept.impulses.size(); ++c) {
      const Vector3& j = swept.impulses[c];
      EXPECT_LE(j.tail<2>().norm(), island.problem.contacts[c].friction * j[0] * (1 + 1e-12) + 1e-12);
    }
  }
}

// Coulomb's law may have several answers with redundant contacts, so two ways need not meet. What must hold: sweeping
// on from the island solver's answer leaves it where it is, and most islands give the same velocities from zero.
TEST(GaussSeidel, AgreesWithTheIslandSolver) {
  qp::IslandSolver solver;
  qp::GaussSeidel sweeper;
  qp::Solution solution;
  int reached = 0, same = 0, total = 0;
  for (const NamedProblem& island : RandomIslands(72, 45, 10, false)) {
    SCOPED_TRACE(island.name);
    ++total;
    qp::Settings settings;
    settings.coulomb_rounds = 60;
    settings.tolerance = 1e-12;
    settings.velocity_scale = VelocityScale(island.problem);
    solver.Solve(island.problem, settings, &solution);
    const double scale = settings.velocity_scale, goal = settings.coulomb_tolerance * scale;
    if (qp::CoulombMap(island.problem, solution.velocities, solution.impulses).rms > goal) continue;
    ++reached;
    Swept polished{solution.impulses, solution.velocities, 0};
    sweeper.Prepare(island.problem);
    sweeper.Sweep(island.problem, 20000, 1e-13 * scale, &polished.impulses, &polished.velocities);
    EXPECT_LT(VelocityDistance(island.problem, polished.velocities, solution.velocities), 1e-4 * scale);
    const Swept swept = SweepFromZero(island.problem, 20000, 1e-13 * scale);
    EXPECT_LT(qp::CoulombMap(island.problem, swept.velocities, swept.impulses).rms, 1e-4 * scale);
    if (VelocityDistance(island.problem, swept.velocities, solution.velocities) < 1e-4 * scale) ++same;
  }
  EXPECT_GE(reached, total * 9 / 10);
  EXPECT_GE(same, reached * 8 / 10);
}

TEST(GaussSeidel, SweepsAllocateNothing) {
  Random random(73);
  const Problem problem = RandomStack(&random, 4, 0.3, 0.6, 10);
  qp::GaussSeidel solver;
  std::vector<Vector3> impulses(problem.contacts.size(), Vector3::Zero());
  std::vector<double> velocities = FreeVelocities(problem);
  solver.Prepare(problem);
  const AllocationCounter counter;
  solver.Prepare(problem);
  solver.Sweep(problem, 10, 0, &impulses, &velocities);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
