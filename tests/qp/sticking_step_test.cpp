#include "qp/sticking_step.h"

#include <gtest/gtest.h>

#include "qp/body_algebra.h"
#include "qp/island_solver.h"
#include "qp/natural_map.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::StickingStep;

// A column of boxes of random masses, a face between each two, at rest but for what gravity adds in a step.
Problem Column(Random* random, int boxes, double friction) {
  ProblemBuilder builder;
  for (int i = 0; i < boxes; ++i) {
    const double x = random->Uniform(-0.05, 0.05), y = random->Uniform(-0.05, 0.05);
    builder.AddBox({x, y, 0.5 + i}, {0.5, 0.5, 0.5}, random->Uniform(0.5, 2));
    builder.AddFace(i - 1, i, {x, y, 1.0 * i}, 0.45, 0.45, friction);
  }
  for (qp::BodyTerm& body : builder.problem.bodies) body.velocity << 0, 0, -0.3, 0, 0, 0;
  return builder.problem;
}

qp::Solution SolveFirst(const Problem& problem) {
  qp::IslandSolver solver;
  qp::Solution solution;
  qp::Settings settings;
  settings.model = qp::Model::kCoulomb;
  settings.tolerance = 1e-12;
  settings.velocity_scale = 0.3;
  settings.coulomb_tolerance = 1e-10;
  solver.Solve(problem, settings, &solution);
  return solution;
}

// Disturbs what holds the column by `size` of the velocities that gravity gives, and takes the step.
struct Taken {
  double before, after, momentum, outside;  // natural map, M (v - v0) - J^T j [velocity], impulse out of its cone
};

Taken Disturb(Random* random, int boxes, double size) {
  Problem problem = Column(random, boxes, 0.5);
  std::vector<Vector3> impulses = SolveFirst(problem).impulses;
  for (qp::BodyTerm& body : problem.bodies)
    for (int k = 0; k < 6; ++k) body.velocity[k] += random->Uniform(-1, 1) * size * 0.3;
  std::vector<double> scales, velocities, again;
  qp::ImpulseScales(problem, &scales);
  qp::VelocitiesAfter(problem, impulses, &velocities);
  Taken taken{};
  taken.before = qp::CoulombMap(problem, velocities, impulses, scales).max;
  EXPECT_TRUE(StickingStep::Fits(problem, impulses));
  StickingStep step;
  step.Take(problem, scales, 0, &impulses, &velocities);
  taken.after = qp::CoulombMap(problem, velocities, impulses, scales).max;
  qp::VelocitiesAfter(problem, impulses, &again);
  for (size_t i = 0; i < again.size(); ++i)
    taken.momentum = std::max(taken.momentum, std::abs(again[i] - velocities[i]));
  for (int c = 0; c < problem.num_contacts(); ++c)
    taken.outside = std::max(
        taken.outside, (impulses[c] - qp::ProjectOnCircularCone(impulses[c], problem.contacts[c].friction)).norm());
  return taken;
}

TEST(StickingStep, LeavesNextToNothingOfASmallDisturbance) {
  Random random(401);
  for (const int boxes : {1, 2, 5, 10, 30}) {
    for (int trial = 0; trial < 5; ++trial) {
      const Taken taken = Disturb(&random, boxes, 1e-6);
      EXPECT_GT(taken.before, 1e-8) << boxes;
      EXPECT_LT(taken.after, 1e-2 * taken.before) << boxes;
      EXPECT_LT(taken.momentum, 1e-14) << boxes;
      EXPECT_LT(taken.outside, 1e-14) << boxes;
    }
  }
}

TEST(StickingStep, BringsAContactToItsTarget) {
  Random random(402);
  Problem problem = Column(&random, 3, 0.5);
  std::vector<Vector3> impulses = SolveFirst(problem).impulses;
  for (int c = 8; c < 12; ++c) problem.contacts[c].target = 1e-6;  // the uppermost face opens
  std::vector<double> scales, velocities;
  qp::ImpulseScales(problem, &scales);
  qp::VelocitiesAfter(problem, impulses, &velocities);
  StickingStep step;
  step.Take(problem, scales, 0, &impulses, &velocities);
  for (int c = 0; c < problem.num_contacts(); ++c)
    EXPECT_NEAR(qp::ContactVelocity(problem.contacts[c], velocities.data())[0], problem.contacts[c].target, 1e-9) << c;
}

TEST(StickingStep, DoesNotFitWhatSlidesNorTouchesWhatDoesNotPress) {
  Random random(403);
  Problem problem = Column(&random, 3, 0.5);
  std::vector<Vector3> impulses = SolveFirst(problem).impulses;
  ASSERT_TRUE(StickingStep::Fits(problem, impulses));
  std::vector<Vector3> sliding = impulses;
  sliding[5][1] = 0.5 * sliding[5][0], sliding[5][2] = 0;
  EXPECT_FALSE(StickingStep::Fits(problem, sliding));
  problem.contacts.push_back(problem.contacts.back());  // a twin that bears nothing
  impulses.push_back(Vector3::Zero());
  problem.bodies[1].velocity[0] += 1e-7;
  std::vector<double> scales, velocities;
  qp::ImpulseScales(problem, &scales);
  qp::VelocitiesAfter(problem, impulses, &velocities);
  StickingStep step;
  step.Take(problem, scales, 0, &impulses, &velocities);
  EXPECT_EQ(impulses.back(), Vector3::Zero());
}

TEST(StickingStep, AllocatesNothingAgain) {
  Random random(404);
  const Problem problem = Column(&random, 8, 0.5);
  std::vector<Vector3> impulses = SolveFirst(problem).impulses;
  std::vector<double> scales, velocities;
  qp::ImpulseScales(problem, &scales);
  qp::VelocitiesAfter(problem, impulses, &velocities);
  StickingStep step;
  step.Take(problem, scales, 0, &impulses, &velocities);
  const AllocationCounter counter;
  step.Take(problem, scales, 0, &impulses, &velocities);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
