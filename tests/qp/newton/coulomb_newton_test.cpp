#include "qp/newton/coulomb_newton.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "qp/body_algebra.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

struct Answer {
  qp::NaturalMap map;
  std::vector<Vector3> impulses;
  std::vector<double> velocities;
  int factorisations;
};

Answer Solve(const Problem& problem, double goal, std::vector<Vector3> start = {}, int most = 150) {
  qp::CoulombNewton newton;
  std::vector<double> rho, velocities;
  qp::ImpulseScales(problem, &rho);
  start.resize(problem.contacts.size(), Vector3::Zero());
  const qp::NaturalMap map = newton.Solve(problem, rho, {goal, goal}, most, &start);
  qp::VelocitiesAfter(problem, start, &velocities);
  return {map, start, velocities, newton.factorisations()};
}

// A box of 2 kg at (0, 0, 0.5) on four corners, that has slid along x and y by `speed` and falls at g dt = 1.
Problem SlidingBox(const Vector3& velocity, double friction) {
  ProblemBuilder builder;
  builder.AddBox({0, 0, 0.1}, {1, 1, 0.1}, 2);
  builder.problem.bodies[0].velocity.head<3>() = velocity;
  for (const double x : {-1.0, 1.0})
    for (const double y : {-1.0, 1.0}) builder.AddContact(-1, 0, {x, y, 0}, Vector3::UnitZ(), friction);
  return builder.problem;
}

double NormalSum(const Answer& answer) {
  double sum = 0;
  for (const Vector3& j : answer.impulses) sum += j[0];
  return sum;
}

// Fast: friction takes mu g dt off, whatever the corners carry. Slow: it sticks, and the impulses are those of a sum in one's head.
TEST(CoulombNewton, ABoxThatSlidesAndOneThatStops) {
  const Answer slides = Solve(SlidingBox({3, 4, -1}, 0.3), 1e-12);
  EXPECT_NEAR(NormalSum(slides), 2, 1e-11);
  EXPECT_NEAR(slides.velocities[0], 3 * (1 - 0.3 / 5), 1e-10);
  EXPECT_NEAR(slides.velocities[1], 4 * (1 - 0.3 / 5), 1e-10);
  EXPECT_NEAR(slides.velocities[2], 0, 1e-11);
  const Answer stops = Solve(SlidingBox({0.03, 0.04, -1}, 0.3), 1e-12);
  EXPECT_NEAR(NormalSum(stops), 2, 1e-11);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(stops.velocities[i], 0, 1e-11) << i;
}

// Four corners are one too many. From no impulses they share alike.
TEST(CoulombNewton, RedundantCornersShareTheLoad) {
  const Answer answer = Solve(SlidingBox({0, 0, -1}, 0.3), 1e-12);
  for (const Vector3& j : answer.impulses) EXPECT_NEAR(j[0], 0.5, 1e-11);
}

// A body that rises needs no impulse, a contact that yields gives way by its compliance.
TEST(CoulombNewton, NothingPressesAndSomethingYields) {
  EXPECT_EQ(NormalSum(Solve(SlidingBox({0, 0, 1}, 0.3), 1e-12)), 0);
  Problem soft = SlidingBox({0, 0, -1}, 0.3);
  for (qp::ContactTerm& contact : soft.contacts) contact.compliance = 0.25;
  const Answer answer = Solve(soft, 1e-12);  // j / 4 each: v = -1 + j / 2 and v + 0.25 j / 4 = 0
  EXPECT_NEAR(NormalSum(answer), 1 / (0.5 + 0.0625), 1e-11);
}

TEST(CoulombNewton, RandomIslandsObeyTheLaw) {
  int solved = 0, islands = 0;
  for (const NamedProblem& island : RandomIslands(401, 150, 100, true)) {
    SCOPED_TRACE(island.name);
    const double v_ref = VelocityScale(island.problem);
    const Answer answer = Solve(island.problem, 1e-9 * v_ref);
    const qp::NaturalMap map = qp::CoulombMap(island.problem, answer.velocities, answer.impulses);
    EXPECT_EQ(map.max, answer.map.max);
    EXPECT_LT(MomentumResidual(island.problem, answer.velocities, answer.impulses), 1e-11 * v_ref);
    for (int c = 0; c < island.problem.num_contacts(); ++c) {
      const Vector3& j = answer.impulses[c];
      EXPECT_LE(j.tail<2>().norm(), island.problem.contacts[c].friction * j[0] * (1 + 1e-12));
    }
    ++islands;
    solved += map.max <= 1e-8 * v_ref;
  }
  EXPECT_GE(solved, islands * 95 / 100) << islands;
}

// The order of the contacts decides about rounding alone.
TEST(CoulombNewton, OrderOfContactsDoesNotMatter) {
  Random random(402);
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE(trial);
    Problem problem = RandomCluster(&random, 8, 0.2, 0.6, 10);
    const double goal = 1e-11 * VelocityScale(problem);
    const Answer first = Solve(problem, goal);
    std::shuffle(problem.contacts.begin(), problem.contacts.end(), random.engine());
    const Answer second = Solve(problem, goal);
    if (first.map.max > goal || second.map.max > goal) continue;
    EXPECT_LT(VelocityDistance(problem, first.velocities, second.velocities), 1e-7 * VelocityScale(problem));
  }
}

// From an answer nothing is left to do; no more is spent than was allowed, and what is returned is never worse than the start.
TEST(CoulombNewton, KeepsWhatIsRightAndItsBudget) {
  Random random(403);
  for (int trial = 0; trial < 20; ++trial) {
    const Problem problem = RandomCluster(&random, 8, 0.2, 0.6, 10);
    const double v_ref = VelocityScale(problem);
    const Answer answer = Solve(problem, 1e-9 * v_ref);
    if (answer.map.max <= 1e-9 * v_ref) {
      EXPECT_EQ(Solve(problem, 1e-9 * v_ref, answer.impulses).factorisations, 0);
    }
    const double before = Solve(problem, 1e-9 * v_ref, {}, 0).map.rms;
    for (const int most : {2, 5, 10}) {
      const Answer cut = Solve(problem, 1e-9 * v_ref, {}, most);
      EXPECT_LE(cut.factorisations, most);
      EXPECT_LE(cut.map.rms, before);
    }
  }
}

TEST(CoulombNewton, RepeatedSolveAllocatesNothing) {
  Random random(404);
  const Problem problem = RandomCluster(&random, 10, 0.2, 0.6, 10);
  qp::CoulombNewton newton;
  std::vector<double> rho;
  qp::ImpulseScales(problem, &rho);
  std::vector<Vector3> impulses(problem.contacts.size(), Vector3::Zero());
  const double goal = 1e-9 * VelocityScale(problem);
  newton.Solve(problem, rho, {goal, goal}, 100, &impulses);
  std::fill(impulses.begin(), impulses.end(), Vector3::Zero());
  const AllocationCounter counter;
  newton.Solve(problem, rho, {goal, goal}, 100, &impulses);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
