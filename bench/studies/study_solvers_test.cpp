// The solvers and measures that the studies bring along, against answers worked out by hand and by brute force.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "bench/studies/ipopt_solver.h"
#include "bench/studies/lorentz_cone.h"
#include "bench/studies/reference_interior_point.h"
#include "bench/studies/study_problem.h"
#include "qp/cascade/island_solver.h"

namespace islet::studies {
namespace {

using qp::Vector3;

// A point of mass 1 on a plane, mu = 1/2: u = j + q.
GeneralProblem OnePoint(const Vector3& velocity) {
  GeneralProblem problem;
  problem.mass.resize(3, 3), problem.mass.setIdentity();
  problem.coupling = problem.mass;
  problem.load = velocity;
  problem.drift.setZero(3);
  problem.friction.setConstant(1, 0.5);
  return problem;
}

struct Expected {
  Vector3 velocity, impulse;  // normal first
};
// The answer is the point of the cone that is nearest to -q: inside it, on it (at 1.2 (1, -1/2)), and at its apex.
const Expected kExpected[] = {
    {{-1, 0.2, 0.1}, {1, -0.2, -0.1}}, {{-1, 1, 0}, {1.2, -0.6, 0}}, {{1, 0.1, 0}, {0, 0, 0}}};

TEST(StudySolvers, ReferenceOnOnePoint) {
  if (!ReferenceAvailable()) GTEST_SKIP() << "built without CHOLMOD";
  for (const Expected& e : kExpected) {
    const GeneralAnswer answer = SolveByReference(OnePoint(e.velocity), {.tolerance = 1e-5});
    EXPECT_TRUE(answer.solved);
    EXPECT_LT((answer.j - e.impulse).norm(), 1e-5) << answer.j.transpose();
    EXPECT_LT((answer.v - e.velocity - e.impulse).norm(), 1e-5);
  }
}

TEST(StudySolvers, IpoptOnOnePoint) {
  if (!IpoptAvailable()) GTEST_SKIP() << "built without IPOPT";
  for (const Expected& e : kExpected) {
    const GeneralAnswer answer = SolveByIpopt(OnePoint(e.velocity), {.tolerance = 1e-5});
    EXPECT_TRUE(answer.solved);
    // At the apex the squared cone has no gradient: impulses of the root of its tolerance stay.
    EXPECT_LT((answer.j - e.impulse).norm(), 1e-3) << answer.j.transpose();
  }
}

// Velocities of the convex problem are unique: islet and the reference must agree on a pile.
TEST(StudySolvers, ReferenceAgreesWithIslet) {
  if (!ReferenceAvailable()) GTEST_SKIP() << "built without CHOLMOD";
  const qp::Island pile = qp::MakePile(3, 2, 2);
  const int nb = pile.problem.num_bodies(), nc = pile.problem.num_contacts();
  std::vector<Eigen::Triplet<double>> mass, coupling;
  GeneralProblem general;
  general.load.resize(6 * nb), general.drift.setZero(3 * nc), general.friction.resize(nc);
  for (int i = 0; i < nb; ++i) {
    const qp::BodyTerm& body = pile.problem.bodies[i];
    for (int k = 0; k < 3; ++k) mass.emplace_back(6 * i + k, 6 * i + k, body.mass);
    for (int k = 0; k < 9; ++k) mass.emplace_back(6 * i + 3 + k / 3, 6 * i + 3 + k % 3, body.inertia(k / 3, k % 3));
    general.load.segment<3>(6 * i) = body.mass * body.velocity.head<3>();
    general.load.segment<3>(6 * i + 3) = body.inertia * body.velocity.tail<3>();
  }
  for (int c = 0; c < nc; ++c) {
    const qp::ContactTerm& contact = pile.problem.contacts[c];
    general.friction[c] = contact.friction;
    for (int k = 0; k < 18; ++k) {
      if (contact.body_a >= 0)
        coupling.emplace_back(6 * contact.body_a + k % 6, 3 * c + k / 6, contact.jacobian_a(k / 6, k % 6));
      if (contact.body_b >= 0)
        coupling.emplace_back(6 * contact.body_b + k % 6, 3 * c + k / 6, contact.jacobian_b(k / 6, k % 6));
    }
  }
  general.mass.resize(6 * nb, 6 * nb), general.mass.setFromTriplets(mass.begin(), mass.end());
  general.coupling.resize(6 * nb, 3 * nc), general.coupling.setFromTriplets(coupling.begin(), coupling.end());
  const GeneralAnswer theirs = SolveByReference(general, {.tolerance = 1e-4});
  qp::Settings settings;
  settings.model = qp::Model::kConvex, settings.velocity_scale = pile.scale, settings.tolerance = 1e-12;
  qp::Solution ours;
  qp::IslandSolver().Solve(pile.problem, settings, &ours);
  const Eigen::Map<const Eigen::VectorXd> v(ours.velocities.data(), 6 * nb);
  EXPECT_LT((v - theirs.v).cwiseAbs().maxCoeff(), 1e-4 * pile.scale);
}

TEST(StudySolvers, KineticMapVanishesAtTheAnswerAlone) {
  qp::Island tower = qp::MakeTower(3);
  for (qp::ContactTerm& contact : tower.problem.contacts) contact.target = 0.1;
  tower.problem.bodies[2].velocity[2] = -1;
  qp::Settings settings;
  settings.model = qp::Model::kKinetic, settings.tolerance = 1e-12;
  for (const qp::Cone cone : {qp::Cone::kCircular, qp::Cone::kOctagon}) {
    settings.cone = cone;
    qp::Solution solution;
    qp::IslandSolver().Solve(tower.problem, settings, &solution);
    EXPECT_LT(KineticMap(tower, solution, cone), 1e-5);
    qp::Solution wrong = solution;
    wrong.bounce_multipliers[0] += 1e-2;
    EXPECT_GT(KineticMap(tower, wrong, cone), 1e-4);
    wrong = solution;
    wrong.velocities[0] += 1e-2;
    EXPECT_GT(KineticMap(tower, wrong, cone), 1e-4);
  }
}

// No point of the cone is nearer: rays of the circle, and of the octagon between neighbouring edges.
TEST(StudySolvers, ProjectionIsNearest) {
  std::mt19937 engine(3);
  const auto number = [&engine] { return static_cast<double>(engine()) / 2147483648.0 - 1; };
  for (const qp::Cone cone : {qp::Cone::kCircular, qp::Cone::kOctagon}) {
    for (int trial = 0; trial < 50; ++trial) {
      const double mu = 0.1 + std::abs(number());
      const Vector3 x(number(), number(), number());
      const double reached = (ProjectOn(x, mu, cone) - x).norm();
      double least = x.norm();
      for (int k = 0; k < 3600; ++k) {
        const double angle = k * M_PI / 1800, within = std::remainder(angle, M_PI / 4);
        const double radius = cone == qp::Cone::kCircular ? mu : mu * std::cos(M_PI / 8) / std::cos(within);
        for (const double share : {0.0, 0.5, 1.0}) {
          const Vector3 ray(1, share * radius * std::cos(angle), share * radius * std::sin(angle));
          least = std::min(least, (std::max(0.0, x.dot(ray) / ray.squaredNorm()) * ray - x).norm());
        }
      }
      EXPECT_LE(reached, least + 1e-12);
      if (reached > 0) {
        EXPECT_NEAR(reached, least, 1e-5);
      } else {
        EXPECT_LT(least, 0.5);  // rays through the inside of the cone come near any point of it
      }
    }
  }
}

TEST(StudySolvers, LorentzCone) {
  const Vector3 s(2, 1, -0.5), z(0.7, -0.3, 0.6), d(-1, 0.4, 0.2);
  EXPECT_LT((lorentz::Product(s, lorentz::Quotient(d, s)) - d).norm(), 1e-14);
  const lorentz::Scaling scaling(s, z);
  EXPECT_LT((scaling.w * z - scaling.inverse * s).norm(), 1e-14);
  EXPECT_LT((scaling.w * scaling.inverse - lorentz::Matrix3::Identity()).norm(), 1e-13);
  EXPECT_LT((scaling.inverse * scaling.inverse - scaling.inverse_squared).norm(), 1e-13);
  const Vector3 edge = s + lorentz::StepToBoundary(s, d) * d;
  EXPECT_NEAR(edge[0], edge.tail<2>().norm(), 1e-14);
  EXPECT_TRUE(std::isinf(lorentz::StepToBoundary(s, {1, 0.5, 0})));
}

}  // namespace
}  // namespace islet::studies
