#include "qp/normal_interior_point.h"

#include <gtest/gtest.h>

#include <cmath>

#include "qp/interior_point.h"
#include "qp/island_solver.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"
#include "tests/support/reference_qp.h"

namespace islet::testing {
namespace {

Problem WithoutFriction(Problem problem) {
  for (ContactTerm& contact : problem.contacts) contact.friction = 0;
  return problem;
}

// Balls of diameter 1 in a jittered lattice on the ground, which fall on each other: normals through the centres.
Problem Crate(Random* random, int side, int layers, double mass_ratio = 1) {
  ProblemBuilder builder;
  for (int z = 0; z < layers; ++z)
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) {
        const Vector3 position = Vector3(x, y, z) + random->Vector(0.2);
        const double mass = std::pow(mass_ratio, random->Uniform(-0.5, 0.5));
        const int i =
            builder.AddBody(position, mass, 0.1 * mass * Matrix3::Identity(),
                            (Vector6() << random->Vector(0.2) - Vector3(0, 0, 0.3), random->Vector(1)).finished());
        if (z == 0) builder.AddContact(-1, i, position - Vector3(0, 0, 0.5), Vector3::UnitZ(), 0);
        for (int k = 0; k < i; ++k) {
          const Vector3 apart = position - builder.positions[k];
          if (apart.norm() < 1.3) builder.AddContact(k, i, position - 0.5 * apart, apart.normalized(), 0);
        }
      }
  return builder.problem;
}

struct Answer {
  bool solved = false;
  std::vector<Vector3> impulses;
  std::vector<double> velocities;
  double gap = 0, approach = 0;  // [J]; [m/s] that some contact still approaches its target by
};

// From no impulses, or from those given.
Answer Solve(const Problem& problem, double tolerance, double map, const std::vector<Vector3>& start = {}) {
  qp::NormalInteriorPoint solver;
  qp::Settings settings;
  settings.tolerance = tolerance;
  settings.velocity_scale = VelocityScale(problem);
  Answer out;
  out.impulses = start;
  out.impulses.resize(problem.contacts.size(), Vector3::Zero());
  out.velocities = FreeVelocities(problem);
  for (int c = 0; c < problem.num_contacts(); ++c)
    qp::ApplyImpulse(problem, problem.contacts[c], out.impulses[c], out.velocities.data());
  out.solved = solver.Solve(problem, settings, map, out.velocities, &out.impulses);
  out.velocities = FreeVelocities(problem);
  for (int c = 0; c < problem.num_contacts(); ++c)
    qp::ApplyImpulse(problem, problem.contacts[c], out.impulses[c], out.velocities.data());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const double u = qp::ContactVelocity(problem.contacts[c], out.velocities.data())[0] - problem.contacts[c].target;
    out.gap += std::abs(u * out.impulses[c][0]);
    out.approach = std::max(out.approach, -u);
  }
  return out;
}

TEST(NormalInteriorPoint, MeetsTheLaw) {
  Random random(11);
  for (int trial = 0; trial < 12; ++trial) {
    const bool balls = trial % 2 == 0;
    Problem problem =
        balls ? Crate(&random, 3 + trial / 4, 3) : WithoutFriction(RandomStack(&random, 3 + trial, 0, 0, 10));
    if (trial % 3 == 0) SetBounces(0.3, &problem);
    const double scale = VelocityScale(problem), tolerance = 1e-9;
    const Answer answer = Solve(problem, tolerance, 1e-2 * scale);
    ASSERT_TRUE(answer.solved) << trial;
    double energy = KineticEnergy(problem, FreeVelocities(problem));
    for (const qp::BodyTerm& body : problem.bodies) energy += 0.5 * body.mass * scale * scale;
    EXPECT_LT(answer.gap, 10 * tolerance * energy) << trial;
    EXPECT_LT(answer.approach, 10 * tolerance * scale) << trial;
    for (const Vector3& j : answer.impulses) EXPECT_TRUE(j[0] > 0 && j[1] == 0 && j[2] == 0) << trial;
  }
}

// Chains, clusters and stacks of all mass ratios up to 1e6, most of them with lever arms.
TEST(NormalInteriorPoint, FindsTheVelocitiesOfTheReference) {
  for (const NamedProblem& named : RandomIslands(12, 40, 1e6, false)) {
    const Problem problem = WithoutFriction(named.problem);
    const double scale = VelocityScale(problem);
    const Answer answer = Solve(problem, 1e-13, 1e-2 * scale);
    if (!answer.solved) continue;  // it may give up, but must not claim
    const ReferenceSolution reference = SolveReference(problem, qp::Model::kConvex, qp::Cone::kCircular);
    EXPECT_LT(VelocityDistance(problem, answer.velocities, reference.velocities), 1e-5 * scale) << named.name;
  }
}

TEST(NormalInteriorPoint, SolvesRandomIslandsWithoutTheirFriction) {
  int solved = 0, problems = 0;
  for (const NamedProblem& named : RandomIslands(13, 60, 1e6, false)) {
    const Problem problem = WithoutFriction(named.problem);
    ++problems;
    solved += Solve(problem, 1e-8, 1e-2 * VelocityScale(problem)).solved;
  }
  EXPECT_GE(solved, problems - 2);
}

// What the answer of before is good for.
TEST(NormalInteriorPoint, TakesFewerFactorisationsFromNearTheAnswer) {
  Random random(14);
  const Problem problem = Crate(&random, 5, 4);
  const double scale = VelocityScale(problem);
  qp::Settings settings;
  settings.velocity_scale = scale;
  settings.tolerance = 1e-8;
  const Answer answer = Solve(problem, 1e-10, 1e-2 * scale);
  ASSERT_TRUE(answer.solved);
  qp::NormalInteriorPoint solver;
  std::vector<Vector3> cold(problem.contacts.size(), Vector3::Zero()), warm = answer.impulses;
  ASSERT_TRUE(solver.Solve(problem, settings, 1e-2 * scale, FreeVelocities(problem), &cold));
  const int from_nothing = solver.factorisations();
  ASSERT_TRUE(solver.Solve(problem, settings, 1e-6 * scale, answer.velocities, &warm));
  EXPECT_LE(solver.factorisations() + 2, from_nothing);
}

TEST(NormalInteriorPoint, GivesUpWhereThereIsNoAnswer) {
  Random random(15);
  Problem problem = Crate(&random, 4, 3);
  for (int i = 0; i < 2; ++i) {
    ContactTerm wall = problem.contacts[0];
    ASSERT_EQ(wall.body_a, -1);
    if (i == 1) wall.jacobian_b = -wall.jacobian_b;
    wall.drift[0] = -1;  // both close on the ball
    problem.contacts.push_back(wall);
  }
  const Answer answer = Solve(problem, 1e-8, VelocityScale(problem));
  EXPECT_FALSE(answer.solved);

  qp::IslandSolver whole;
  qp::Settings settings;
  settings.velocity_scale = VelocityScale(problem);
  qp::Solution solution;
  whole.Solve(problem, settings, &solution);
  EXPECT_EQ(solution.status, qp::Status::kInfeasible);
  EXPECT_EQ(solution.rung, qp::Rung::kInteriorPoint);
  for (const double v : solution.velocities) EXPECT_TRUE(std::isfinite(v));
}

TEST(NormalInteriorPoint, RepeatedSolveAllocatesNothing) {
  Random random(16);
  const Problem problem = Crate(&random, 4, 4);
  const std::vector<double> velocities = FreeVelocities(problem);
  const std::vector<Vector3> start(problem.contacts.size(), Vector3::Zero());
  std::vector<Vector3> impulses = start;
  qp::Settings settings;
  settings.velocity_scale = VelocityScale(problem);
  qp::NormalInteriorPoint solver;
  ASSERT_TRUE(solver.Solve(problem, settings, 1e-2, velocities, &impulses));
  impulses = start;
  const AllocationCounter counter;
  solver.Solve(problem, settings, 1e-2, velocities, &impulses);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
