#include "qp/normal_newton.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "qp/interior_point.h"
#include "qp/normal_system.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

// Balls that rest on the ground and on each other: normals through the centres.
Problem HeapOfBalls(Random* random, int balls) {
  ProblemBuilder builder;
  for (int i = 0; i < balls; ++i) {
    const Vector3 position(random->Uniform(0, 3), random->Uniform(0, 3), random->Uniform(0.5, 3));
    builder.AddBody(position, random->Uniform(0.5, 2), 0.1 * Matrix3::Identity(),
                    (Vector6() << random->Vector(1), random->Vector(1)).finished());
    builder.AddContact(-1, i, position - Vector3(0, 0, 0.5), Vector3::UnitZ(), 0);
    for (int k = 0; k < i; ++k) {
      const Vector3 apart = position - builder.positions[k];
      if (apart.norm() < 1.2) builder.AddContact(k, i, position - 0.5 * apart, apart.normalized(), 0);
    }
  }
  return builder.problem;
}

Problem WithoutFriction(Problem problem) {
  for (ContactTerm& contact : problem.contacts) contact.friction = 0;
  return problem;
}

std::vector<double> VelocitiesOf(const Problem& problem, const std::vector<Vector3>& impulses) {
  std::vector<double> velocities = FreeVelocities(problem);
  for (int c = 0; c < problem.num_contacts(); ++c)
    qp::ApplyImpulse(problem, problem.contacts[c], impulses[c], velocities.data());
  return velocities;
}

TEST(NormalSystem, EqualsTheDenseMatrix) {
  Random random(1);
  qp::NormalSystem system;
  for (int trial = 0; trial < 20; ++trial) {
    const bool balls = trial % 2 == 0;
    const Problem problem = balls ? HeapOfBalls(&random, 12) : WithoutFriction(RandomStack(&random, 5, 0, 0, 100));
    system.Prepare(problem);
    const int width = system.width(), n = width * problem.num_bodies();
    ASSERT_EQ(width, balls ? 3 : 6);
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(n, n);
    for (int i = 0; i < problem.num_bodies(); ++i) {
      dense.block<3, 3>(width * i, width * i) = problem.bodies[i].mass * Matrix3::Identity();
      if (width == 6) dense.block<3, 3>(6 * i + 3, 6 * i + 3) = problem.bodies[i].inertia;
    }
    std::vector<double> sigma;
    for (const ContactTerm& contact : problem.contacts) {
      sigma.push_back(random.Integer(0, 2) == 0 ? 0 : random.Uniform(0.1, 100));
      Eigen::VectorXd row = Eigen::VectorXd::Zero(n);
      if (contact.body_a >= 0) row.segment(width * contact.body_a, width) += contact.jacobian_a.row(0).head(width);
      if (contact.body_b >= 0) row.segment(width * contact.body_b, width) += contact.jacobian_b.row(0).head(width);
      dense += sigma.back() * row * row.transpose();
    }
    EXPECT_EQ(system.Factorise(sigma), 0);
    const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(n, [&] { return random.Uniform(-1, 1); });
    std::vector<double> x(b.data(), b.data() + n);
    system.Solve(x.data());
    const Eigen::Map<const Eigen::VectorXd> found(x.data(), n);
    EXPECT_LT((dense * found - b).norm(), 1e-12 * dense.norm() * found.norm());
  }
}

// Velocities are unique, impulses are not: those of the interior point are the reference.
TEST(NormalNewton, FindsTheVelocitiesOfTheInteriorPoint) {
  Random random(2);
  qp::NormalNewton newton;
  qp::InteriorPoint interior_point;
  int answers = 0;
  for (int trial = 0; trial < 60; ++trial) {
    Problem problem = trial % 2 == 0 ? HeapOfBalls(&random, 1 + trial / 2)
                                     : WithoutFriction(RandomStack(&random, 1 + trial / 10, 0, 0, 10));
    if (trial % 3 == 0) SetBounces(0.3, &problem);
    const double scale = VelocityScale(problem);
    std::vector<Vector3> impulses(problem.contacts.size(), Vector3::Zero());
    const bool found = newton.Solve(problem, 1e-9 * scale, 60, &impulses);
    qp::Settings settings;
    settings.velocity_scale = scale;
    settings.tolerance = 1e-13;
    qp::Solution reference;
    interior_point.Solve(problem, settings, {}, &reference);
    if (reference.status == qp::Status::kInfeasible) {
      EXPECT_FALSE(found) << trial;
      continue;
    }
    if (!found) continue;  // it may give up, but must not claim
    ++answers;
    EXPECT_LT(VelocityDistance(problem, VelocitiesOf(problem, impulses), reference.velocities), 1e-6 * scale) << trial;
    for (const Vector3& j : impulses) EXPECT_GE(j[0], 0);
  }
  EXPECT_GE(answers, 55);
}

// Two walls that close on a ball.
TEST(NormalNewton, GivesUpWhereThereIsNoAnswer) {
  ProblemBuilder builder;
  builder.AddBody(Vector3::Zero(), 1, Matrix3::Identity());
  builder.AddContact(-1, 0, Vector3(0, 0, -1), Vector3::UnitZ(), 0);
  builder.AddContact(-1, 0, Vector3(0, 0, 1), -Vector3::UnitZ(), 0);
  for (ContactTerm& contact : builder.problem.contacts) contact.drift[0] = -1;
  std::vector<Vector3> impulses(2, Vector3::Zero());
  qp::NormalNewton newton;
  EXPECT_FALSE(newton.Solve(builder.problem, 1e-9, 100, &impulses));
}

TEST(NormalNewton, RepeatedSolveAllocatesNothing) {
  Random random(3);
  const Problem problem = HeapOfBalls(&random, 40);
  const std::vector<Vector3> start(problem.contacts.size(), Vector3::Zero());
  std::vector<Vector3> impulses = start;
  qp::NormalNewton newton;
  ASSERT_TRUE(newton.Solve(problem, 1e-9, 60, &impulses));
  impulses = start;
  const AllocationCounter counter;
  newton.Solve(problem, 1e-9, 60, &impulses);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
