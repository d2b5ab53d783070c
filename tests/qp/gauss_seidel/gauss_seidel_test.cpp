#include "qp/gauss_seidel/gauss_seidel.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "parallel/worker_pool.h"
#include "qp/cascade/island_solver.h"
#include "qp/direct/one_contact.h"
#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

struct Swept {
  std::vector<Vector3> impulses;
  std::vector<double> velocities;
  int sweeps = 0;
};

Swept SweepFromZero(const Problem& problem, int most, double tolerance, qp::Pace pace = qp::Pace::kPlain,
                    qp::Precision precision = qp::Precision::kDouble) {
  qp::GaussSeidel solver;
  Swept swept{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), FreeVelocities(problem), 0};
  solver.Prepare(problem);
  swept.sweeps = solver.Sweep(problem, most, tolerance, &swept.impulses, &swept.velocities, pace, precision);
  return swept;
}

// The same sweeps as plainly as can be: contacts in the order of the problem, velocities in the world's frame.
Swept SweepPlainly(const Problem& problem, int sweeps) {
  Swept swept{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), FreeVelocities(problem), sweeps};
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (int c = 0; c < problem.num_contacts(); ++c) {
      const ContactTerm& contact = problem.contacts[c];
      const Matrix3 w = qp::DelassusBlock(problem, contact) + contact.compliance * Matrix3::Identity();
      const qp::OneContact law(w);
      Vector3& j = swept.impulses[c];
      Vector3 q = qp::ContactVelocity(contact, swept.velocities.data()) + contact.compliance * j - w * j;
      q[0] -= contact.target;
      const Vector3 next = law.SolveCoulomb(q, contact.friction);
      qp::ApplyImpulse(problem, contact, next - j, swept.velocities.data());
      j = next;
    }
  }
  return swept;
}

const std::vector<qp::SweepKernelSet>& AllKernels() {
  static const std::vector<qp::SweepKernelSet> all = [] {
    std::vector<qp::SweepKernelSet> sets;
    for (const char* name : {"sse2", "avx2", "avx512"})
      if (const qp::SweepKernelSet set = qp::FindSweepKernels(name); set.plain) sets.push_back(set);
    return sets;
  }();
  return all;
}

// In every kernel set. Directions of sliding are found to about 1e-6 in one visit.
void ExpectLikePlainSweeps(const Problem& problem, int sweeps, double tolerance) {
  const Swept plain = SweepPlainly(problem, sweeps);
  const double scale = VelocityScale(problem);
  for (const qp::SweepKernelSet& kernels : AllKernels()) {
    SCOPED_TRACE(kernels.plain->name);
    qp::GaussSeidel solver(kernels);
    Swept swept{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), FreeVelocities(problem), 0};
    solver.Prepare(problem);
    solver.Sweep(problem, sweeps, 0, &swept.impulses, &swept.velocities, qp::Pace::kPlain);
    EXPECT_LT(VelocityDistance(problem, plain.velocities, swept.velocities), tolerance * scale);
    for (size_t c = 0; c < problem.contacts.size(); ++c) {
      const double w = qp::DelassusBlock(problem, problem.contacts[c])(0, 0) + problem.contacts[c].compliance;
      EXPECT_LT((plain.impulses[c] - swept.impulses[c]).norm() * w, 100 * tolerance * scale) << "contact " << c;
    }
  }
}

// What one machine computes another one does, too.
TEST(GaussSeidel, BitsAreThoseOfTheNarrowest) {
  for (const NamedProblem& island : RandomIslands(79, 40, 100, true)) {
    SCOPED_TRACE(island.name);
    for (const qp::Precision precision : {qp::Precision::kDouble, qp::Precision::kSingle}) {
      std::vector<double> narrowest;
      for (const qp::SweepKernelSet& kernels : AllKernels()) {
        SCOPED_TRACE(kernels.plain->name);
        const Problem& problem = island.problem;
        qp::GaussSeidel solver(kernels);
        Swept swept{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), FreeVelocities(problem), 0};
        solver.Prepare(problem);
        solver.Sweep(problem, 50, 0, &swept.impulses, &swept.velocities, qp::Pace::kMomentum, precision);
        if (narrowest.empty()) narrowest = swept.velocities;
        EXPECT_EQ(swept.velocities, narrowest);
      }
    }
  }
}

TEST(GaussSeidel, LikePlainSweeps) {
  for (const NamedProblem& island : RandomIslands(74, 40, 100, true)) {
    SCOPED_TRACE(island.name);
    ExpectLikePlainSweeps(island.problem, 6, 2e-6);
  }
}

TEST(GaussSeidel, LikePlainSweepsWithExtremeMasses) {
  for (const NamedProblem& island : RandomIslands(75, 20, 1e8, false)) {
    SCOPED_TRACE(island.name);
    ExpectLikePlainSweeps(island.problem, 4, 1e-5);
  }
}

TEST(GaussSeidel, LikePlainSweepsWithoutFriction) {
  for (NamedProblem& island : RandomIslands(76, 20, 10, true)) {
    SCOPED_TRACE(island.name);
    for (size_t c = 0; c < island.problem.contacts.size(); c += c % 3 + 1) island.problem.contacts[c].friction = 0;
    ExpectLikePlainSweeps(island.problem, 6, 2e-6);
    for (ContactTerm& contact : island.problem.contacts) contact.friction = 0;
    ExpectLikePlainSweeps(island.problem, 6, 1e-10);
  }
}

TEST(GaussSeidel, LikePlainSweepsWithCompliance) {
  Random random(77);
  for (NamedProblem& island : RandomIslands(78, 20, 10, true)) {
    SCOPED_TRACE(island.name);
    for (ContactTerm& contact : island.problem.contacts) contact.compliance = std::max(0.0, random.Uniform(-0.5, 1));
    ExpectLikePlainSweeps(island.problem, 6, 2e-6);
  }
}

// A contact whose tangents move nothing, as in a plane.
// 1,000 sweeps come as near to the law as either can.
TEST(GaussSeidel, SinglePrecisionMeetsTheLawToItsRounding) {
  Random random(84);
  const Problem problems[] = {RandomCluster(&random, 200, 0.3, 0.6, 1), RandomCluster(&random, 100, 0, 0, 100),
                              RandomStack(&random, 10, 0.3, 0.6, 1)};
  for (const Problem& problem : problems) {
    for (const qp::SweepKernelSet& kernels : AllKernels()) {
      SCOPED_TRACE(kernels.single->name);
      const double scale = VelocityScale(problem);
      qp::GaussSeidel solver(kernels);
      const auto map_after = [&](qp::Precision precision) {
        Swept swept{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), FreeVelocities(problem), 0};
        solver.Prepare(problem);
        solver.Sweep(problem, 1000, 0, &swept.impulses, &swept.velocities, qp::Pace::kMomentum, precision);
        EXPECT_LT(MomentumResidual(problem, swept.velocities, swept.impulses), 1e-12);
        for (size_t c = 0; c < swept.impulses.size(); ++c) {
          const Vector3& j = swept.impulses[c];
          EXPECT_LE(j.tail<2>().norm(), problem.contacts[c].friction * j[0] * (1 + 1e-14)) << c;
        }
        return qp::CoulombMap(problem, swept.velocities, swept.impulses).rms;
      };
      EXPECT_LT(map_after(qp::Precision::kDouble), 1e-7 * scale);
      const double single = map_after(qp::Precision::kSingle);
      EXPECT_LT(single, 1e-4 * scale);
      EXPECT_GT(single, 1e-7 * scale);  // not double in disguise
    }
  }
}

// With its walls a heap may travel at a thousand times the speed that counts in it: nothing changes.
TEST(GaussSeidel, SinglePrecisionIsTheSameInAFrameThatMoves) {
  Random random(84);
  for (const bool friction : {false, true}) {
    const Problem rests = friction ? RandomCluster(&random, 60, 0.2, 0.8, 10) : RandomCluster(&random, 60, 0, 0, 10);
    const double scale = VelocityScale(rests);
    const auto map_at = [&](double speed) {
      Problem problem = rests;
      const Vector3 v = speed * scale * Vector3(2, 1, -2) / 3;
      for (qp::BodyTerm& body : problem.bodies) body.velocity.head<3>() += v;
      for (ContactTerm& c : problem.contacts) {
        if (c.body_a < 0) c.drift -= c.jacobian_b.leftCols<3>() * v;
        if (c.body_b < 0) c.drift -= c.jacobian_a.leftCols<3>() * v;
      }
      const Swept swept = SweepFromZero(problem, 1000, 0, qp::Pace::kMomentum, qp::Precision::kSingle);
      return qp::CoulombMap(problem, swept.velocities, swept.impulses).rms;
    };
    const double at_rest = map_at(0);
    EXPECT_LT(at_rest, 1e-4 * scale);
    for (const double speed : {30.0, 1000.0}) EXPECT_LT(map_at(speed), 4 * at_rest) << friction << speed;
  }
}

// Without friction a few sweeps take both the same way. With it, directions of sliding are left a step behind in single
// precision, and sweeps have to settle first.
TEST(GaussSeidel, SinglePrecisionGoesTheSameWay) {
  for (NamedProblem& island : RandomIslands(85, 30, 10, true)) {
    SCOPED_TRACE(island.name);
    const double scale = VelocityScale(island.problem);
    const auto distance = [&](int sweeps) {
      const Swept plain = SweepFromZero(island.problem, sweeps, 0);
      const Swept single = SweepFromZero(island.problem, sweeps, 0, qp::Pace::kPlain, qp::Precision::kSingle);
      return VelocityDistance(island.problem, plain.velocities, single.velocities);
    };
    EXPECT_LT(distance(3), 0.05 * scale);
    EXPECT_LT(distance(1000), 1e-4 * scale);
    for (ContactTerm& contact : island.problem.contacts) contact.friction = 0;
    EXPECT_LT(distance(3), 1e-4 * scale);
  }
}

TEST(GaussSeidel, FlatContacts) {
  ProblemBuilder builder;
  builder.AddBox({0, 0, 0.5}, {0.5, 0.5, 0.5}, 2, {0.3, 8, -1});
  builder.AddContact(-1, 0, Vector3::Zero(), Vector3::UnitZ(), 0.2);
  builder.problem.contacts[0].jacobian_b.row(2).setZero();
  const Swept swept = SweepFromZero(builder.problem, 10, 0);
  EXPECT_GT(swept.impulses[0][0], 1);
  EXPECT_NEAR(std::abs(swept.impulses[0][1]), 0.2 * swept.impulses[0][0], 1e-12);
  EXPECT_EQ(swept.impulses[0][2], 0);
}

TEST(GaussSeidel, ExactLawAtEveryContactAfterConvergence) {
  int converged = 0, total = 0;
  for (const NamedProblem& island : RandomIslands(79, 40, 10, true)) {
    SCOPED_TRACE(island.name);
    const double scale = VelocityScale(island.problem);
    const qp::Pace pace = total % 2 == 0 ? qp::Pace::kPlain : qp::Pace::kMomentum;
    const Swept swept = SweepFromZero(island.problem, 20000, 1e-13 * scale, pace);
    ++total;
    if (swept.sweeps == 20000) continue;
    ++converged;
    EXPECT_LT(qp::CoulombMap(island.problem, swept.velocities, swept.impulses).max, 1e-10 * scale);
    for (size_t c = 0; c < swept.impulses.size(); ++c) {
      const Vector3& j = swept.impulses[c];
      EXPECT_GE(j[0], 0);
      EXPECT_LE(j.tail<2>().norm(), island.problem.contacts[c].friction * j[0] * (1 + 1e-13) + 1e-15);
    }
  }
  EXPECT_GE(converged, total * 9 / 10);
}

TEST(GaussSeidel, MomentumCarriesLoadsFaster) {
  Random random(83);
  const auto map_after = [&](const Problem& problem, int sweeps, qp::Pace pace) {
    qp::GaussSeidel solver;
    Swept swept{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), FreeVelocities(problem), 0};
    solver.Prepare(problem);
    solver.Sweep(problem, sweeps, 0, &swept.impulses, &swept.velocities, pace);
    EXPECT_LT(MomentumResidual(problem, swept.velocities, swept.impulses), 1e-10);
    return qp::CoulombMap(problem, swept.velocities, swept.impulses).rms;
  };
  const Problem tower = RandomStack(&random, 60, 0.3, 0.6, 1), heap = RandomCluster(&random, 200, 0.3, 0.6, 1);
  EXPECT_LT(map_after(tower, 300, qp::Pace::kMomentum), 0.7 * map_after(tower, 300, qp::Pace::kPlain));
  EXPECT_LT(map_after(heap, 300, qp::Pace::kMomentum), 0.1 * map_after(heap, 300, qp::Pace::kPlain));
}

TEST(GaussSeidel, SameBitsForAnyNumberOfThreads) {
  Random random(80);
  const Problem problem = RandomStack(&random, 600, 0.1, 0.6, 10);
  ASSERT_GE(problem.num_contacts(), 1500);
  for (const qp::Precision precision : {qp::Precision::kDouble, qp::Precision::kSingle}) {
    const auto sweep = [&] { return SweepFromZero(problem, 30, 0, qp::Pace::kMomentum, precision); };
    const Swept alone = sweep();
    for (int workers : {1, 2, 4, 8}) {
      parallel::WorkerPool pool(workers);
      for (int repeat = 0; repeat < 3; ++repeat) {
        Swept swept;
        pool.ForEach(1, [&](int, int) { swept = sweep(); });
        ASSERT_EQ(swept.velocities.size(), alone.velocities.size());
        const size_t bytes = sizeof(double) * alone.velocities.size();
        EXPECT_EQ(std::memcmp(swept.velocities.data(), alone.velocities.data(), bytes), 0);
        for (size_t c = 0; c < swept.impulses.size(); ++c) ASSERT_EQ(swept.impulses[c], alone.impulses[c]) << c;
      }
    }
  }
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
    settings.velocity_scale = VelocityScale(island.problem);
    solver.Solve(island.problem, settings, &solution);
    const double scale = settings.velocity_scale, goal = settings.tolerance * scale;
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
  const auto sweep = [&] {
    solver.Prepare(problem);
    solver.Sweep(problem, 10, 0, &impulses, &velocities);
    solver.Sweep(problem, 10, 0, &impulses, &velocities, qp::Pace::kMomentum, qp::Precision::kSingle);
  };
  sweep();
  const AllocationCounter counter;
  sweep();
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
