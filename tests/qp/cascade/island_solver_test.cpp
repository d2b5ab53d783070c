#include "qp/cascade/island_solver.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "qp/body_algebra.h"
#include "qp/direct/one_contact.h"
#include "qp/interior_point/interior_point.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"
#include "tests/support/reference_qp.h"
#include "tests/support/solve.h"

namespace islet::testing {
namespace {

using qp::Cone;
using qp::Model;
using qp::NaturalMap;

Problem SlidingCube() {
  ProblemBuilder builder;
  builder.AddBox({0, 0, 0.05}, {0.05, 0.05, 0.05}, 1, {6, 0, -9.81 / 30});
  builder.AddFace(-1, 0, Vector3::Zero(), 0.05, 0.05, 0.5);
  return builder.problem;
}

TEST(IslandSolver, NoContactsLeaveTheVelocities) {
  ProblemBuilder builder;
  builder.AddBox({0, 0, 0}, {1, 1, 1}, 2, {1, 2, 3});
  for (const Model model : {Model::kKinetic, Model::kConvex, Model::kCoulomb}) {
    const qp::Solution solution = Solve(builder.problem, MakeSettings(builder.problem, model));
    EXPECT_EQ(solution.status, qp::Status::kSolved);
    EXPECT_EQ(solution.velocities, FreeVelocities(builder.problem));
    EXPECT_TRUE(solution.impulses.empty());
  }
}

TEST(IslandSolver, NothingAtAll) {
  const qp::Solution solution = Solve(Problem(), qp::Settings());
  EXPECT_EQ(solution.status, qp::Status::kSolved);
  EXPECT_TRUE(solution.velocities.empty());
}

TEST(IslandSolver, CoulombDoesNotLiftWhatSlides) {
  const Problem problem = SlidingCube();
  const qp::Solution solution = Solve(problem, MakeSettings(problem, Model::kCoulomb));
  EXPECT_EQ(solution.status, qp::Status::kSolved);
  EXPECT_NEAR(solution.velocities[2], 0, 1e-5);
  EXPECT_NEAR(solution.velocities[0], 6 - 0.5 * 9.81 / 30, 1e-5);  // slowed by mu g dt
}

// More bodies than the island may have to be solved accurately in every round.
Problem TallStack(double sideways) {
  ProblemBuilder builder;
  for (int i = 0; i < 15; ++i) {
    builder.AddBox({0, 0, 0.5 + i}, {0.5, 0.5, 0.5}, 1, {sideways, 0, -9.81 / 60});
    builder.AddFace(i - 1, i, {0, 0, 1.0 * i}, 0.5, 0.5, 0.5);
  }
  return builder.problem;
}

// Nothing slides: the slips of the first round, which is rough, are right already.
TEST(IslandSolver, OctagonCoulombOnATallStackAtRest) {
  const Problem problem = TallStack(0);
  const qp::Solution solution = Solve(problem, MakeSettings(problem, Model::kCoulomb, Cone::kOctagon));
  EXPECT_EQ(solution.status, qp::Status::kSolved);
  ASSERT_EQ(solution.velocities.size(), 6u * problem.num_bodies());
  EXPECT_LE(solution.gap, 1e-8);
  const std::vector<double> rest(solution.velocities.size(), 0.0);
  EXPECT_LT(VelocityDistance(problem, solution.velocities, rest), 1e-4 * VelocityScale(problem));
}

TEST(IslandSolver, OctagonCoulombOnATallStackThatSlides) {
  const Problem problem = TallStack(2);
  qp::Settings settings = MakeSettings(problem, Model::kCoulomb, Cone::kOctagon);
  for (const int sweeps : {20, 100, 3000}) {
    settings.effort.sweeps = sweeps;
    const qp::Solution solution = Solve(problem, settings);
    EXPECT_EQ(solution.status, sweeps == 3000 ? qp::Status::kSolved : qp::Status::kInaccurate);
    ASSERT_EQ(solution.velocities.size(), 6u * problem.num_bodies());
    EXPECT_LE(solution.gap, 1e-8);
    EXPECT_LT(MomentumResidual(problem, solution.velocities, solution.impulses), 1e-6);
  }
}

TEST(IslandSolver, OneContactIsTheClosedForm) {
  Random random(91);
  for (int trial = 0; trial < 50; ++trial) {
    Problem problem = RandomChain(&random, 1, 0, 1.5, 1);
    if (trial % 2) SetBounces(0.5, &problem);
    const ContactTerm& contact = problem.contacts[0];
    const qp::Solution solution = Solve(problem, MakeSettings(problem, Model::kCoulomb));
    Vector3 q = qp::ContactVelocity(contact, FreeVelocities(problem).data());
    q[0] -= contact.target;
    const Vector3 expected = qp::OneContact(qp::DelassusBlock(problem, contact)).SolveCoulomb(q, contact.friction);
    EXPECT_EQ(solution.impulses[0], expected);
    EXPECT_LT(qp::CoulombMap(problem, solution.velocities, solution.impulses).rms, 1e-10);
    // The same contact twice shares the load and gives the same velocity, by the iterative way.
    Problem twice = problem;
    twice.contacts.push_back(contact);
    qp::Settings settings = MakeSettings(twice, Model::kCoulomb);
    EXPECT_LT(VelocityDistance(problem, Solve(twice, settings).velocities, solution.velocities), 1e-4);
  }
}

// Against the independent dense solver. The answer's energy is within gap of the optimum, so velocities are within the
// root of it; islands on which the reference itself has not converged do not count, and must be few.
void CompareWithReference(Model model, Cone cone, bool bounces, std::uint32_t seed) {
  int total = 0, trusted = 0, inaccurate = 0;
  for (const NamedProblem& island : RandomIslands(seed, 30, 1e6, bounces)) {
    SCOPED_TRACE(island.name);
    const ReferenceSolution reference = SolveReference(island.problem, model, cone);
    ++total;
    if (!(reference.residual <= 1e-6)) continue;
    ++trusted;
    qp::Settings settings = MakeSettings(island.problem, model, cone);
    settings.aim = 1e-13;
    const qp::Solution solution = Solve(island.problem, settings);
    EXPECT_TRUE(solution.status == qp::Status::kSolved || solution.status == qp::Status::kInaccurate)
        << qp::ToString(solution.status);
    if (solution.status == qp::Status::kInaccurate) ++inaccurate;
    EXPECT_LT(VelocityDistance(island.problem, reference.velocities, solution.velocities),
              std::max(2e-4, 2 * std::sqrt(solution.gap)) * settings.velocity_scale);
  }
  EXPECT_GE(trusted, total * 8 / 10);
  EXPECT_LE(inaccurate, 3);  // at mass ratios near 1e6 the residuals may end just above 1e-8
}

TEST(IslandSolverAgainstReference, Convex) { CompareWithReference(Model::kConvex, Cone::kCircular, false, 1); }
TEST(IslandSolverAgainstReference, ConvexOctagon) { CompareWithReference(Model::kConvex, Cone::kOctagon, false, 2); }
TEST(IslandSolverAgainstReference, ConvexBounces) { CompareWithReference(Model::kConvex, Cone::kCircular, true, 3); }
TEST(IslandSolverAgainstReference, ConvexBouncesOctagon) {
  CompareWithReference(Model::kConvex, Cone::kOctagon, true, 4);
}
TEST(IslandSolverAgainstReference, KineticWithoutBounces) {
  CompareWithReference(Model::kKinetic, Cone::kCircular, false, 5);
}
TEST(IslandSolverAgainstReference, KineticBounces) { CompareWithReference(Model::kKinetic, Cone::kCircular, true, 6); }
TEST(IslandSolverAgainstReference, KineticBouncesOctagon) {
  CompareWithReference(Model::kKinetic, Cone::kOctagon, true, 7);
}

TEST(IslandSolver, KineticWithoutBouncesEqualsConvex) {
  for (const NamedProblem& island : RandomIslands(92, 20, 100, false)) {
    const qp::Solution kinetic = Solve(island.problem, MakeSettings(island.problem, Model::kKinetic));
    const qp::Solution convex = Solve(island.problem, MakeSettings(island.problem, Model::kConvex));
    EXPECT_EQ(kinetic.velocities, convex.velocities);
  }
}

TEST(IslandSolver, KineticMultipliersFulfilTheirConditions) {
  for (const NamedProblem& island : RandomIslands(93, 40, 100, true)) {
    SCOPED_TRACE(island.name);
    const qp::Solution solution = Solve(island.problem, MakeSettings(island.problem, Model::kKinetic));
    EXPECT_EQ(solution.status, qp::Status::kSolved);
    if (solution.multipliers.empty()) continue;  // nothing approached
    double gap = 0;
    for (int c = 0; c < island.problem.num_contacts(); ++c) {
      const ContactTerm& contact = island.problem.contacts[c];
      const Vector3 w = qp::ContactVelocity(contact, solution.multipliers.data());
      const double excess = qp::ContactVelocity(contact, solution.velocities.data())[0] - contact.target;
      EXPECT_GT(excess, -1e-3);
      EXPECT_GE(solution.bounce_multipliers[c], 0);
      gap += solution.bounce_multipliers[c] * excess + solution.impulses[c].dot(w);
    }
    EXPECT_NEAR(gap, 0, 1e-4);
    EXPECT_LT(MomentumResidual(island.problem, solution.velocities, solution.impulses), 1e-9);
  }
}

// Share of 300 islands on which the natural map of exact Coulomb falls below `goal` times the velocity scale.
double ShareBelow(double goal, bool bounces, double mass_ratio) {
  int reached = 0, total = 0;
  for (const NamedProblem& island : RandomIslands(94, 300, mass_ratio, bounces)) {
    const qp::Settings settings = MakeSettings(island.problem, Model::kCoulomb);
    const qp::Solution solution = Solve(island.problem, settings);
    EXPECT_LT(MomentumResidual(island.problem, solution.velocities, solution.impulses), 1e-6) << island.name;
    const NaturalMap map = qp::CoulombMap(island.problem, solution.velocities, solution.impulses);
    EXPECT_EQ(solution.status == qp::Status::kSolved, map.Meets(settings.tolerance * settings.velocity_scale))
        << island.name;
    ++total;
    if (map.rms <= goal * settings.velocity_scale) ++reached;
  }
  return static_cast<double>(reached) / total;
}

// By hand: a cube on four corners that slides at 6 m/s and falls at g dt.
TEST(IslandSolver, ContactSpeedByHand) {
  const Problem problem = SlidingCube();
  EXPECT_NEAR(qp::ContactSpeed(problem, FreeVelocities(problem).data()), std::hypot(6, 9.81 / 30), 1e-12);
  EXPECT_EQ(qp::ContactSpeed(Problem(), nullptr), 0);
}

// Where answers of what moves may be inexact, sweeps do, from impulses that are nearly right. What stands is as exact as ever.
TEST(IslandSolver, WhatMovesMayBeInexactAndWhatStandsIsNot) {
  for (const double sideways : {3.0, 0.0}) {
    const Problem problem = TallStack(sideways);
    qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
    settings.ladder = settings.ladder.Without(qp::Rung::kColumn).Without(qp::Rung::kHeld);
    qp::IslandSolver solver;
    qp::Solution exact, rough;
    solver.Solve(problem, settings, &exact);
    std::vector<Vector3> start = exact.impulses;
    for (Vector3& j : start) j *= 0.9999;
    settings.speed_share = 1e-7;
    solver.Solve(problem, settings, &rough, start);
    const NaturalMap map = qp::CoulombMap(problem, rough.velocities, rough.impulses);
    EXPECT_LE(map.rms, (sideways > 0 ? 1e-4 : 1e-10) * settings.velocity_scale);
    EXPECT_EQ(rough.iterations > 0, sideways == 0);  // Newton's
  }
}

TEST(IslandSolver, CoulombMapByDefault) {
  EXPECT_GE(ShareBelow(1e-8, false, 10), 0.95);
  EXPECT_GE(ShareBelow(1e-8, true, 10), 0.95);
}
TEST(IslandSolver, CoulombMapAtLargeMassRatios) {
  EXPECT_GE(ShareBelow(1e-6, false, 1e6), 0.96);
  EXPECT_GE(ShareBelow(1e-6, true, 1e6), 0.96);
}

TEST(IslandSolver, OrderOfContactsAndBodiesDoesNotMatter) {
  Random random(95);
  for (const NamedProblem& island : RandomIslands(96, 40, 100, false)) {
    SCOPED_TRACE(island.name);
    const int nb = island.problem.num_bodies();
    std::vector<int> place(nb);
    std::iota(place.begin(), place.end(), 0);
    std::shuffle(place.begin(), place.end(), random.engine());
    Problem shuffled = island.problem;
    for (int i = 0; i < nb; ++i) shuffled.bodies[place[i]] = island.problem.bodies[i];
    for (ContactTerm& contact : shuffled.contacts) {
      if (contact.body_a >= 0) contact.body_a = place[contact.body_a];
      if (contact.body_b >= 0) contact.body_b = place[contact.body_b];
    }
    std::shuffle(shuffled.contacts.begin(), shuffled.contacts.end(), random.engine());
    for (const Model model : {Model::kConvex, Model::kCoulomb}) {
      qp::Settings settings = MakeSettings(island.problem, model);
      settings.aim =
          1e-14;  // a gap of 1e-8 leaves 1e-4 of the velocity open, and the two orders may use that differently
      const qp::Solution one = Solve(island.problem, settings), other = Solve(shuffled, settings);
      if (model == Model::kCoulomb) {
        const double goal = settings.tolerance * settings.velocity_scale;
        if (qp::CoulombMap(island.problem, one.velocities, one.impulses).rms > goal) continue;
        if (qp::CoulombMap(shuffled, other.velocities, other.impulses).rms > goal) continue;
      }
      std::vector<double> back(one.velocities.size());
      for (int i = 0; i < nb; ++i) std::copy_n(&other.velocities[6 * place[i]], 6, &back[6 * i]);
      EXPECT_LT(VelocityDistance(island.problem, one.velocities, back),
                std::max(model == Model::kCoulomb ? 1e-3 : 5e-4, 2 * std::sqrt(one.gap + other.gap)) *
                    settings.velocity_scale)
          << static_cast<int>(model);
    }
  }
}

TEST(IslandSolver, SameProblemSameBitsWhateverWasSolvedBefore) {
  qp::IslandSolver used;
  qp::Solution solution;
  for (const NamedProblem& island : RandomIslands(97, 30, 1e3, true)) {
    const qp::Settings settings = MakeSettings(island.problem, Model::kCoulomb);
    used.Solve(island.problem, settings, &solution);
    EXPECT_EQ(solution.velocities, Solve(island.problem, settings).velocities) << island.name;
  }
}

TEST(IslandSolver, RepeatedSolveAllocatesNothing) {
  Random random(98);
  Problem problem = RandomCluster(&random, 14, 0.2, 0.8, 10);
  SetBounces(0.3, &problem);
  for (const Cone cone : {Cone::kCircular, Cone::kOctagon}) {
    for (const Model model : {Model::kKinetic, Model::kConvex, Model::kCoulomb}) {
      const qp::Settings settings = MakeSettings(problem, model, cone);
      qp::IslandSolver solver;
      qp::Solution solution;
      solver.Solve(problem, settings, &solution);
      const AllocationCounter counter;
      solver.Solve(problem, settings, &solution);
      EXPECT_EQ(counter.count(), 0) << "model " << static_cast<int>(model) << " cone " << static_cast<int>(cone);
    }
  }
}

// u + (slip - target) n of a contact, compliance included.
Vector3 ShiftedVelocity(const ContactTerm& contact, const qp::Solution& solution, size_t c, double slip) {
  Vector3 u = qp::ContactVelocity(contact, solution.velocities.data()) + contact.compliance * solution.impulses[c];
  u[0] += slip - contact.target;
  return u;
}

// Natural map of exact Coulomb, by distances to the cone in place of the solver's projection. [velocity, rms]
double ExactMap(const Problem& problem, const qp::Solution& solution) {
  double sum = 0;
  for (size_t c = 0; c < problem.contacts.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const double mu = contact.friction, rho = 3 / qp::DelassusBlock(problem, contact).trace();
    Vector3 u = ShiftedVelocity(contact, solution, c, 0);
    u[0] += mu * u.tail<2>().norm();
    const Vector3 x = solution.impulses[c] - rho * u;
    const double tangent = x.tail<2>().norm();
    Vector3 nearest = x;
    if (x[0] < 0 || tangent > mu * x[0]) {
      Vector3 edge(1, 0, 0);
      if (tangent > 0) edge.tail<2>() = mu / tangent * x.tail<2>();
      edge.normalize();
      nearest = std::max(0.0, edge.dot(x)) * edge;
    }
    sum += (solution.impulses[c] - nearest).squaredNorm() / rho / rho;
  }
  return std::sqrt(sum / std::max(1, problem.num_contacts()));
}

qp::Settings OffTheLadder(qp::Settings settings) {
  settings.ladder = qp::Ladder::Off();
  return settings;
}

Problem RestingStack(Random* random) {
  Problem problem = RandomStack(random, 6, 0.5, 0.5, 10);
  for (qp::BodyTerm& body : problem.bodies) body.velocity << 0, 0, -0.3, 0, 0, 0;
  return problem;
}

// Every answer of the ladder is that of the full method, and says which rung it came from.
TEST(Ladder, AgreesWithTheFullMethod) {
  std::array<int, qp::kNumRungs> used{};
  for (const double friction : {0.0, 0.5}) {
    Random random(105);
    for (int trial = 0; trial < 60; ++trial) {
      const int bodies = random.Integer(1, 20);
      const Problem problem = trial % 2 == 0 ? RandomCluster(&random, bodies, friction, friction, 10)
                                             : RandomStack(&random, 1 + bodies / 4, friction, friction, 10);
      qp::Settings settings = MakeSettings(problem, friction > 0 ? Model::kConvex : Model::kCoulomb);
      const qp::Solution full = Solve(problem, OffTheLadder(settings)), climbed = Solve(problem, settings);
      EXPECT_LE(VelocityDistance(problem, full.velocities, climbed.velocities), 1e-5 * settings.velocity_scale);
      EXPECT_EQ(full.rung, qp::Rung::kInteriorPoint);
      ++used[static_cast<int>(climbed.rung)];
    }
  }
  EXPECT_GT(used[static_cast<int>(qp::Rung::kNewton)], 30);
  EXPECT_GT(used[static_cast<int>(qp::Rung::kInteriorPoint)], 30);
}

TEST(Ladder, ImpulsesThatStillHoldAreKept) {
  Random random(106);
  const Problem problem = RestingStack(&random);
  qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
  settings.ladder = settings.ladder.Without(qp::Rung::kColumn);
  qp::IslandSolver solver;
  qp::Solution first, second;
  solver.Solve(problem, settings, &first);
  solver.Solve(problem, settings, &second, first.impulses);
  EXPECT_EQ(second.rung, qp::Rung::kHeld);
  EXPECT_LT(VelocityDistance(problem, first.velocities, second.velocities), 1e-8 * settings.velocity_scale);
  solver.Solve(problem, OffTheLadder(settings), &second, first.impulses);
  EXPECT_NE(second.rung, qp::Rung::kHeld);
}

// A push that is a millionth of the weight, and one at which the stack begins to slide.
TEST(Ladder, ImpulsesThatNoLongerHoldAreNotKept) {
  Random random(107);
  const Problem problem = RestingStack(&random);
  const qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
  qp::IslandSolver solver;
  qp::Solution first, second;
  solver.Solve(problem, settings, &first);
  for (const double push : {2e-6, 1.0}) {
    Problem pushed = problem;
    pushed.bodies[3].velocity[0] += push * settings.velocity_scale;
    solver.Solve(pushed, settings, &second, first.impulses);
    EXPECT_NE(second.rung, qp::Rung::kHeld) << push;
    const qp::Solution full = Solve(pushed, OffTheLadder(settings));
    EXPECT_LT(VelocityDistance(problem, full.velocities, second.velocities), 1e-5 * settings.velocity_scale) << push;
  }
}

// Heaps and towers at rest or sliding, whose impulses of the frame before are off by next to nothing, a little, and much, or are
// to hold contacts on the edge of sliding: what is kept obeys the law to a thousandth of the tolerance at every contact, and what
// does not is not kept.
TEST(Ladder, WhatHeldIsJudgedAnew) {
  Random random(122);
  int kept = 0, refused = 0;
  for (int trial = 0; trial < 60; ++trial) {
    Problem problem = trial % 2 == 0 ? RandomCluster(&random, 6, 0.5, 0.5, 10) : RandomStack(&random, 4, 0.5, 0.5, 10);
    qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
    settings.tolerance = 1e-10;
    const qp::Solution before = Solve(problem, settings);
    settings.tolerance = 1e-6;
    if (ExactMap(problem, before) > 1e-10 * settings.velocity_scale) continue;
    settings.ladder = qp::Ladder::Off().With(qp::Rung::kHeld);
    for (int decade = -16; decade <= -2; ++decade) {
      SCOPED_TRACE(std::to_string(trial) + " " + std::to_string(decade));
      Problem now = problem;
      std::vector<Vector3> start = before.impulses;
      const double off = std::pow(10.0, decade);
      if (trial % 3 == 0) {  // friction that is just enough, or just not, for what was held
        for (size_t c = 0; c < start.size(); ++c)
          if (start[c][0] > 0) now.contacts[c].friction = (1 - off) * start[c].tail<2>().norm() / start[c][0];
      } else {
        for (Vector3& j : start) j *= 1 + off * random.Uniform(-1, 1);
      }
      qp::IslandSolver solver;
      qp::Solution solution;
      solver.Solve(now, settings, &solution, start);
      const bool held = solution.rung == qp::Rung::kHeld;
      ++(held ? kept : refused);
      if (!held) continue;
      EXPECT_LE(ExactMap(now, solution), 1e-3 * settings.tolerance * settings.velocity_scale);
      EXPECT_LT(MomentumResidual(now, solution.velocities, solution.impulses), 1e-9);
      EXPECT_TRUE(decade <= -4 || trial % 3 == 0);
    }
  }
  EXPECT_GT(kept, 100);
  EXPECT_GT(refused, 100);
}

// Loads under which all contacts hold, well within their cones.
void LetStand(Random* random, Problem* problem) {
  for (qp::BodyTerm& body : problem->bodies) body.velocity.setZero();
  for (const qp::ContactTerm& contact : problem->contacts) {
    const double press = random->Uniform(0.5, 1.5), share = 0.3 * contact.friction * press;
    const Vector3 j(press, random->Uniform(-share, share), random->Uniform(-share, share));
    const auto pull = [&](int number, const qp::Jacobian& jacobian) {
      if (number < 0) return;
      qp::BodyTerm& body = problem->bodies[number];
      const Eigen::Matrix<double, 6, 1> momentum = jacobian.transpose() * j;
      body.velocity.head<3>() -= momentum.head<3>() / body.mass;
      body.velocity.tail<3>() -= body.inverse_inertia * momentum.tail<3>();
    };
    pull(contact.body_a, contact.jacobian_a);
    pull(contact.body_b, contact.jacobian_b);
  }
}

// A heap whose loads change: the answer of the frame before is nearer than none.
TEST(Ladder, SmallIslandsStartFromTheFrameBefore) {
  Random random(117);
  int cold = 0, warm = 0;
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE(trial);
    Problem problem = RandomCluster(&random, 8, 0.5, 0.5, 10);
    LetStand(&random, &problem);
    qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
    settings.ladder = settings.ladder.Without(qp::Rung::kHeld);
    const qp::Solution before = Solve(problem, settings);
    for (qp::BodyTerm& body : problem.bodies)
      body.velocity.head<3>() += 1e-3 * settings.velocity_scale * random.Vector(1);
    cold += Solve(problem, settings).iterations;
    qp::IslandSolver solver;
    qp::Solution after;
    solver.Solve(problem, settings, &after, before.impulses);
    warm += after.iterations;
    EXPECT_EQ(after.status, qp::Status::kSolved);
    EXPECT_LE(ExactMap(problem, after), (after.iterations == 0 ? 1e-8 : 1e-6) * settings.velocity_scale);
  }
  EXPECT_LT(3 * warm, 2 * cold);
}

// The impulses of the frame before say which of several answers comes next, more than the order of the contacts does.
TEST(Ladder, FromTheFrameBeforeOrderMattersLittle) {
  Random random(118);
  int far = 0;
  for (int trial = 0; trial < 100; ++trial) {
    SCOPED_TRACE(trial);
    Problem problem = RandomCluster(&random, 8, 0.5, 0.5, 10);
    LetStand(&random, &problem);
    const qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
    std::vector<Vector3> start = Solve(problem, settings).impulses;
    for (qp::BodyTerm& body : problem.bodies)
      body.velocity.head<3>() += 1e-2 * settings.velocity_scale * random.Vector(1);
    std::vector<int> order(start.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), random.engine());
    Problem shuffled = problem;
    std::vector<Vector3> start_shuffled(start.size());
    for (size_t c = 0; c < order.size(); ++c)
      shuffled.contacts[c] = problem.contacts[order[c]], start_shuffled[c] = start[order[c]];
    qp::IslandSolver solver;
    qp::Solution one, other;
    solver.Solve(problem, settings, &one, start);
    solver.Solve(shuffled, settings, &other, start_shuffled);
    far += VelocityDistance(problem, one.velocities, other.velocities) > 1e-4 * settings.velocity_scale;
  }
  EXPECT_LE(far, 3);
}

// How the corners of a box share its load is free. What it slides and turns by depends on the share, so it must not be that of before, or
// a box would drift to one side, step by step.
TEST(Ladder, WhatSlidesForgetsHowItsLoadWasShared) {
  testing::ProblemBuilder builder;
  Vector6 velocity;
  velocity << 2, 0.5, -0.1, 0, 0, 3;
  builder.AddBody(Vector3::Zero(), 1, Matrix3::Identity() / 6, velocity);
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5}) builder.AddContact(-1, 0, Vector3(x, y, -0.5), Vector3::UnitZ(), 0.5);
  const Problem& problem = builder.problem;
  const qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
  std::vector<double> found;
  for (const double warp : {0.0, 0.02, -0.02}) {
    std::vector<Vector3> start;
    for (int c = 0; c < 4 && warp != 0; ++c) {
      const qp::ContactTerm& contact = problem.contacts[c];
      const Vector3 u = contact.jacobian_b * velocity;
      const double press = 0.025 + (c == 0 || c == 3 ? warp : -warp);
      const double share = contact.friction * press / u.tail<2>().norm();
      start.emplace_back(press, -share * u[1], -share * u[2]);
    }
    qp::IslandSolver solver;
    qp::Solution solution;
    solver.Solve(problem, settings, &solution, start);
    EXPECT_EQ(solution.status, qp::Status::kSolved);
    if (found.empty()) found = solution.velocities;
    EXPECT_EQ(solution.velocities, found) << warp;
  }
}

// Without friction the convex model is Coulomb's. One contact with a trace of it makes them two.
TEST(Ladder, FrictionlessMeansWithoutAnyFriction) {
  Random random(108);
  Problem problem = RandomCluster(&random, 14, 0, 0, 10);
  const qp::Settings settings = MakeSettings(problem, Model::kConvex);
  EXPECT_EQ(Solve(problem, settings).rung, qp::Rung::kNewton);
  problem.contacts[2].friction = 1e-9;
  EXPECT_EQ(Solve(problem, settings).rung, qp::Rung::kInteriorPoint);
}

// By the exact law, too, and what that little friction changes is as little.
TEST(Ladder, NearlyFrictionlessMeetsTheExactLaw) {
  Random random(123);
  for (const double friction : {1e-12, 1e-9, 1e-6}) {
    for (int trial = 0; trial < 10; ++trial) {
      SCOPED_TRACE(::testing::Message() << friction << " " << trial);
      Problem problem = RandomCluster(&random, random.Integer(3, 20), 0, 0, 10);
      const qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
      const qp::Solution smooth = Solve(problem, settings);
      for (size_t c = 0; c < problem.contacts.size(); c += 2) problem.contacts[c].friction = friction;
      const qp::Solution rough = Solve(problem, settings);
      EXPECT_EQ(rough.status, qp::Status::kSolved);
      EXPECT_LE(ExactMap(problem, rough), settings.tolerance * settings.velocity_scale);
      EXPECT_LT(VelocityDistance(problem, smooth.velocities, rough.velocities),
                1e-4 * settings.velocity_scale  // the root of the gap
      );
      for (int c = 0; c < problem.num_contacts(); ++c)
        EXPECT_LE(rough.impulses[c].tail<2>().norm(), (1 + 1e-9) * problem.contacts[c].friction * rough.impulses[c][0]);
    }
  }
}

TEST(IslandSolver, AnswersAreWhatTheySayWhenTheEffortIsSpent) {
  int total = 0, reached = 0;
  Random random(101);
  for (const bool bounces : {false, true}) {
    for (int trial = 0; trial < 20; ++trial) {
      NamedProblem island{std::to_string(trial), RandomCluster(&random, random.Integer(40, 90), 0.2, 0.8, 10)};
      if (bounces) SetBounces(0.5, &island.problem);
      SCOPED_TRACE(island.name);
      qp::Settings settings = MakeSettings(island.problem, Model::kCoulomb);
      settings.effort = {.sweeps = trial % 2 == 0 ? 30 : 3000};
      const qp::Solution solution = Solve(island.problem, settings);
      const double goal = settings.tolerance * settings.velocity_scale;
      const double map = ExactMap(island.problem, solution);
      EXPECT_NEAR(map, qp::CoulombMap(island.problem, solution.velocities, solution.impulses).rms, 1e-3 * map + 1e-12);
      const bool solved = solution.status == qp::Status::kSolved;
      EXPECT_LE(solved ? map : 0, goal);
      ++total;
      reached += solved;
      EXPECT_LT(MomentumResidual(island.problem, solution.velocities, solution.impulses),
                1e-11 * settings.velocity_scale);
      for (int c = 0; c < island.problem.num_contacts(); ++c) {
        const Vector3& j = solution.impulses[c];
        EXPECT_GE(j[0], 0);
        EXPECT_LE(j.tail<2>().norm(), island.problem.contacts[c].friction * j[0] * (1 + 1e-12) + 1e-14);
      }
    }
  }
  EXPECT_EQ(total, 40);
  EXPECT_GE(reached, 10) << reached << " of " << total;
}

TEST(IslandSolver, StartImpulsesDoNotChangeTheAnswer) {
  Random random(103);
  int both = 0, far = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const Problem problem = RandomCluster(&random, random.Integer(14, 30), 0.2, 0.8, 10);
    for (const qp::Effort& effort : {qp::kNormalEffort, qp::kThoroughEffort}) {
      SCOPED_TRACE(std::to_string(trial) + ", " + std::to_string(effort.sweeps) + " sweeps");
      qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
      settings.effort = effort;
      const qp::Solution cold = Solve(problem, settings);
      Problem before = problem;
      for (qp::BodyTerm& body : before.bodies) body.velocity.head<3>() += random.Vector(0.01);
      const qp::Solution other = Solve(before, settings);
      std::vector<Vector3> worse(problem.contacts.size());
      for (Vector3& j : worse) j = random.Vector(1e3);
      qp::IslandSolver solver;
      qp::Solution warm;
      solver.Solve(problem, settings, &warm, worse);
      EXPECT_EQ(warm.velocities, cold.velocities) << "a start worse than none is not used";
      solver.Solve(problem, settings, &warm, std::span(worse).first(1));
      EXPECT_EQ(warm.velocities, cold.velocities) << "nor is one of another size";
      solver.Solve(problem, settings, &warm, other.impulses);
      EXPECT_EQ(warm.status, cold.status);
      if (warm.status != qp::Status::kSolved || cold.status != qp::Status::kSolved) continue;
      ++both;
      far += VelocityDistance(problem, warm.velocities, cold.velocities) > 1e-4 * settings.velocity_scale;
    }
  }
  EXPECT_GE(both, 40);
  EXPECT_LE(far, 2);  // exact friction may have more than one answer
}

// A few impulses that do not fit make the whole worse than none; it is of use all the same.
TEST(IslandSolver, StartImpulsesAreMended) {
  Random random(115);
  for (int trial = 0; trial < 10; ++trial) {
    SCOPED_TRACE(trial);
    const Problem problem = RandomCluster(&random, 100, 0.2, 0.8, 10);
    qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
    const qp::Solution cold = Solve(problem, settings);
    std::vector<Vector3> start = cold.impulses;
    for (size_t c = trial; c < start.size(); c += 40) start[c] += Vector3(10, 0, 0);
    std::vector<double> velocities;
    qp::VelocitiesAfter(problem, start, &velocities);
    const std::vector<Vector3> none(start.size(), Vector3::Zero());
    EXPECT_GT(qp::CoulombMap(problem, velocities, start).rms,
              qp::CoulombMap(problem, FreeVelocities(problem), none).rms);
    qp::IslandSolver solver;
    qp::Solution warm;
    solver.Solve(problem, settings, &warm, start);
    EXPECT_NE(warm.velocities, cold.velocities) << "it was not used";
    EXPECT_LT(ExactMap(problem, warm), std::max(2 * ExactMap(problem, cold), 1e-5 * settings.velocity_scale));
  }
}

// Slips give way by as much as contacts approach, and by no more; what the status says is so.
TEST(IslandSolver, SweepsSatisfyTheSlipsTheyReturn) {
  Random random(116);
  int swept = 0, compliant = 0, missed = 0;
  for (int trial = 0; trial < 60; ++trial) {
    SCOPED_TRACE(trial);
    Problem problem = RandomCluster(&random, 100, 0.7, 1, 100);
    for (ContactTerm& contact : problem.contacts)
      if (trial % 3 == 0) contact.compliance = 0.01 * qp::DelassusBlock(problem, contact)(0, 0);
    qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
    if (trial % 3 != 0) settings.tolerance = 1e-10;  // which sweeps often miss
    const double v_ref = settings.velocity_scale;
    const qp::Solution solution = Solve(problem, settings);
    if (solution.rung != qp::Rung::kSweeps) continue;
    ++(problem.contacts[0].compliance > 0 ? compliant : swept);
    const double goal = settings.tolerance * v_ref;
    const bool solved = solution.status == qp::Status::kSolved;
    if (solved) {
      EXPECT_LE(ExactMap(problem, solution), goal);
    } else {
      EXPECT_LE(ExactMap(problem, solution), 3e-2 * v_ref) << "the effort is spent";
    }
    double gap = 0, energy = 0;
    for (const qp::BodyTerm& body : problem.bodies)
      energy += 0.5 * body.mass * (body.velocity.head<3>().squaredNorm() + v_ref * v_ref);
    for (size_t c = 0; c < problem.contacts.size(); ++c) {
      const ContactTerm& contact = problem.contacts[c];
      const double approach = -ShiftedVelocity(contact, solution, c, 0)[0];
      const Vector3 u = ShiftedVelocity(contact, solution, c, solution.slips[c]);
      const double slide = contact.friction * u.tail<2>().norm();
      EXPECT_NEAR(solution.slips[c] - slide, std::max(0.0, approach), 1e-14 * v_ref);
      EXPECT_GE(u[0], slide - 1e-14 * v_ref);
      gap += std::abs(solution.impulses[c].dot(u));
    }
    EXPECT_NEAR(gap, solution.gap * energy, 1e-12 * energy);
    missed += !solved;
  }
  EXPECT_GE(swept, 10);
  EXPECT_GE(compliant, 3);
  EXPECT_GE(missed, 3) << "of " << swept;
}

// Boxes thrown into a shaft with four walls and a floor, packed so closely that hardly any velocities let all of them bounce:
// every way out is upwards, past neighbours that bounce too.
Problem FullShaft(Random* random, int width, int layers, double restitution) {
  ProblemBuilder builder;
  for (int i = 0; i < width * width * layers; ++i) {
    const Vector3 at(i % width, i / width % width, i / width / width);
    builder.AddBox(at + random->Vector(0.2), {0.5, 0.5, 0.5}, 1, Vector3(0, 0, -5) + random->Vector(2));
  }
  const auto touch = [&](int a, int b, const Vector3& centre, const Vector3& normal) {
    for (int k = 0; k < 3; ++k) builder.AddContact(a, b, centre + random->Vector(0.2), normal, 0.4);
  };
  for (int b = 0; b < width * width * layers; ++b) {
    const Vector3& at = builder.positions[b];
    const int x = b % width, y = b / width % width;
    if (b < width * width) touch(-1, b, at - 0.5 * Vector3::UnitZ(), Vector3::UnitZ());
    if (x == 0) touch(-1, b, at - 0.5 * Vector3::UnitX(), Vector3::UnitX());
    if (x == width - 1) touch(-1, b, at + 0.5 * Vector3::UnitX(), -Vector3::UnitX());
    if (y == 0) touch(-1, b, at - 0.5 * Vector3::UnitY(), Vector3::UnitY());
    if (y == width - 1) touch(-1, b, at + 0.5 * Vector3::UnitY(), -Vector3::UnitY());
    for (int a = 0; a < b; ++a) {
      const Vector3 gap = at - builder.positions[a];
      if (gap.norm() < 1.2) touch(a, b, at - 0.5 * gap, gap.normalized());
    }
  }
  SetBounces(restitution, &builder.problem);
  return builder.problem;
}

// Most of these have no Coulomb answer near by, and the convex problem has none at all. What comes back of big ones has a natural map of
// a few hundredths, and says so; small ones say that their bounces contradict each other, and which are to blame.
TEST(IslandSolver, CollisionsOnTheBrinkOfAJamHaveAUsableAnswer) {
  Random random(106);
  for (int trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE(trial);
    const Problem problem = FullShaft(&random, 3, 3 + trial / 4, 0.1 + 0.2 * (trial % 4));
    const qp::Settings settings = MakeSettings(problem, Model::kCoulomb);
    const qp::Solution solution = Solve(problem, settings);
    if (solution.status == qp::Status::kInfeasible && problem.num_bodies() <= 32) {
      double blamed = 0;
      for (size_t c = 0; c < problem.contacts.size(); ++c)
        if (problem.contacts[c].target > 0) blamed = std::max(blamed, solution.impulses[c][0]);
      EXPECT_GT(blamed, 0);
      continue;
    }
    EXPECT_TRUE(solution.status == qp::Status::kSolved || solution.status == qp::Status::kInaccurate)
        << qp::ToString(solution.status);
    EXPECT_LT(MomentumResidual(problem, solution.velocities, solution.impulses), 1e-9 * settings.velocity_scale);
    EXPECT_LT(ExactMap(problem, solution), 0.15 * settings.velocity_scale);
    for (size_t c = 0; c < problem.contacts.size(); ++c) {
      const Vector3 u = ShiftedVelocity(problem.contacts[c], solution, c, solution.slips[c]);
      EXPECT_GE(u[0] - problem.contacts[c].friction * u.tail<2>().norm(), -1e-6 * settings.velocity_scale);
    }
  }
}

// An effort without end is no less than a small one.
TEST(IslandSolver, AnEndlessEffortIsNoSmallerThanAnother) {
  for (const NamedProblem& island : RandomIslands(321, 20, 10, false)) {
    if (island.problem.contacts.empty()) continue;
    qp::Settings settings = MakeSettings(island.problem, Model::kCoulomb);
    settings.effort = {.sweeps = 1000};
    const double some = ExactMap(island.problem, Solve(island.problem, settings));
    settings.effort = {.sweeps = 1'000'000'000};
    EXPECT_LE(ExactMap(island.problem, Solve(island.problem, settings)),
              std::max(some, settings.tolerance * settings.velocity_scale))
        << island.name;
  }
}

}  // namespace
}  // namespace islet::testing
