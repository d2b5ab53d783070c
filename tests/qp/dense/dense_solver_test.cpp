#include "qp/dense/dense_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "qp/cascade/island_solver.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::DenseProblem;
using qp::DenseSolution;
using qp::Model;
using qp::Status;

DenseProblem OneContact(const Vector3& q, double friction) {
  DenseProblem problem;
  problem.delassus = Matrix3::Identity();
  problem.velocity = q;
  problem.friction = {friction};
  return problem;
}

DenseSolution Solve(const DenseProblem& problem, Model model, double scale = 1, double tolerance = 1e-9) {
  qp::Settings settings;
  settings.model = model;
  settings.tolerance = tolerance;
  settings.velocity_scale = scale;
  qp::DenseSolver solver;
  DenseSolution solution;
  solver.Solve(problem, settings, &solution);
  return solution;
}

void ExpectNear(const Eigen::VectorXd& got, const Eigen::VectorXd& wanted, double tolerance) {
  ASSERT_EQ(got.size(), wanted.size());
  EXPECT_LT((got - wanted).cwiseAbs().maxCoeff(), tolerance) << "got " << got.transpose();
}

// The matrix and velocities of an island's contacts, with bounces in the velocities.
DenseProblem Dense(const Problem& island) {
  const int nb = island.num_bodies(), nc = island.num_contacts();
  Eigen::MatrixXd j = Eigen::MatrixXd::Zero(3 * nc, 6 * nb), inverse_mass = Eigen::MatrixXd::Zero(6 * nb, 6 * nb);
  for (int i = 0; i < nb; ++i) {
    inverse_mass.block<3, 3>(6 * i, 6 * i) = Matrix3::Identity() / island.bodies[i].mass;
    inverse_mass.block<3, 3>(6 * i + 3, 6 * i + 3) = island.bodies[i].inverse_inertia;
  }
  DenseProblem problem;
  problem.velocity.resize(3 * nc);
  const std::vector<double> free = FreeVelocities(island);
  for (int c = 0; c < nc; ++c) {
    const ContactTerm& contact = island.contacts[c];
    if (contact.body_a >= 0) j.block<3, 6>(3 * c, 6 * contact.body_a) = contact.jacobian_a;
    if (contact.body_b >= 0) j.block<3, 6>(3 * c, 6 * contact.body_b) = contact.jacobian_b;
    problem.velocity.segment<3>(3 * c) = qp::ContactVelocity(contact, free.data()) - contact.target * Vector3::UnitX();
    problem.friction.push_back(contact.friction);
  }
  problem.delassus = j * inverse_mass * j.transpose();
  problem.delassus = (0.5 * (problem.delassus + problem.delassus.transpose())).eval();
  return problem;
}

// |j - P_K(j - rho u_hat)| / rho of the worst contact.
double WorstMap(const DenseProblem& problem, const DenseSolution& solution, bool coulomb) {
  double worst = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const double mu = problem.friction[c], rho = 3 / problem.delassus.diagonal().segment<3>(3 * c).sum();
    const Vector3 j = solution.impulses.segment<3>(3 * c);
    Vector3 u = (problem.delassus * solution.impulses + problem.velocity).segment<3>(3 * c);
    if (coulomb) u[0] += mu * u.tail<2>().norm();
    const Vector3 x = j - rho * u;
    const double t = x.tail<2>().norm(), n = std::max(0.0, (x[0] + mu * t) / (1 + mu * mu));
    Vector3 nearest = x;
    if (x[0] < 0 || t > mu * x[0]) nearest << n, x.tail<2>() * (t > 0 ? mu * n / t : 0);
    worst = std::max(worst, (j - nearest).norm() / rho);
  }
  return worst;
}

TEST(DenseSolver, OneContactByHand) {
  // Sticks: the impulse that stops it lies in the cone.
  ExpectNear(Solve(OneContact({-1, 0.3, 0.4}, 0.6), Model::kCoulomb).impulses, Vector3(1, -0.3, -0.4), 1e-9);
  ExpectNear(Solve(OneContact({-1, 0.3, 0.4}, 0.6), Model::kConvex).impulses, Vector3(1, -0.3, -0.4), 1e-9);
  // Slides: exact Coulomb stops the normal velocity, friction is half of that against the slip.
  const DenseSolution slide = Solve(OneContact({-1, 3, 4}, 0.5), Model::kCoulomb);
  ExpectNear(slide.impulses, Vector3(1, -0.3, -0.4), 1e-9);
  ExpectNear(slide.velocities, Vector3(0, 2.7, 3.6), 1e-9);
  EXPECT_EQ(slide.status, Status::kSolved);
  // The convex model projects -q on the cone: (1, 5) on the ray (1, 0.5) is 3.5 / 1.25 = 2.8 of it, and the contact opens.
  ExpectNear(Solve(OneContact({-1, 3, 4}, 0.5), Model::kConvex).impulses, 2.8 * Vector3(1, -0.3, -0.4), 1e-9);
  // Separates; the convex model pushes it open all the same, as u_n < mu |u_t|.
  ExpectNear(Solve(OneContact({0.1, 3, 4}, 0.5), Model::kCoulomb).impulses, Vector3::Zero(), 1e-9);
  ExpectNear(Solve(OneContact({0.1, 3, 4}, 0.5), Model::kConvex).impulses, 1.92 * Vector3(1, -0.3, -0.4), 1e-9);
  // No friction.
  ExpectNear(Solve(OneContact({-1, 3, 4}, 0), Model::kCoulomb).impulses, Vector3(1, 0, 0), 1e-9);
}

TEST(DenseSolver, NothingToSolve) {
  const DenseSolution none = Solve(DenseProblem{Eigen::MatrixXd(0, 0), Eigen::VectorXd(0), {}}, Model::kCoulomb);
  EXPECT_EQ(none.status, Status::kSolved);
  EXPECT_EQ(none.impulses.size(), 0);
}

// One point that four contacts share: any way to split the impulse is right, velocities are those of one contact.
TEST(DenseSolver, RedundantContacts) {
  DenseProblem problem;
  problem.delassus = Matrix3::Identity().replicate(4, 4);
  problem.velocity = Vector3(-1, 3, 4).replicate(4, 1);
  problem.friction.assign(4, 0.5);
  for (const Model model : {Model::kConvex, Model::kCoulomb}) {
    const DenseSolution solution = Solve(problem, model);
    EXPECT_EQ(solution.status, Status::kSolved);
    const Eigen::VectorXd one = Solve(OneContact({-1, 3, 4}, 0.5), model).velocities;
    ExpectNear(solution.velocities, one.replicate(4, 1), 1e-8);
  }
}

TEST(DenseSolver, IslandsOfRigidBodies) {
  int islands = 0;
  for (const NamedProblem& named : RandomIslands(11, 60, 100, false)) {
    SCOPED_TRACE(named.name);
    const DenseProblem problem = Dense(named.problem);
    if (problem.num_contacts() == 0) continue;
    ++islands;
    const double scale = VelocityScale(named.problem);
    const DenseSolution convex = Solve(problem, Model::kConvex, scale, 1e-8);
    EXPECT_EQ(convex.status, Status::kSolved);
    EXPECT_LT(WorstMap(problem, convex, false), 1e-7 * scale);
    // The interior point on the bodies finds the same velocities.
    qp::Settings settings;
    settings.model = Model::kConvex;
    settings.tolerance = 1e-8, settings.aim = 1e-15;
    settings.velocity_scale = scale;
    qp::Solution sparse;
    qp::IslandSolver().Solve(named.problem, settings, &sparse);
    for (int c = 0; c < problem.num_contacts(); ++c) {
      const Vector3 u = qp::ContactVelocity(named.problem.contacts[c], sparse.velocities.data());
      EXPECT_LT((convex.velocities.segment<3>(3 * c) - u).norm(), 1e-3 * scale) << "contact " << c;
    }
    const DenseSolution coulomb = Solve(problem, Model::kCoulomb, scale, 1e-7);
    EXPECT_EQ(coulomb.status, Status::kSolved);
    EXPECT_LT(WorstMap(problem, coulomb, true), 1.01e-6 * scale);
  }
  EXPECT_GE(islands, 50);
}

// The same pile in other units, and beside itself with bodies a billion times lighter. (Velocities are unique in the convex
// model, in exact Coulomb friction they need not be.)
TEST(DenseSolver, Scales) {
  Random random(5);
  const DenseProblem pile = Dense(RandomStack(&random, 3, 0.3, 0.6, 10));
  const int n = pile.num_contacts();
  DenseProblem both;
  both.delassus = Eigen::MatrixXd::Zero(6 * n, 6 * n);
  both.delassus.topLeftCorner(3 * n, 3 * n) = pile.delassus;
  both.delassus.bottomRightCorner(3 * n, 3 * n) = 1e9 * pile.delassus;
  both.velocity = pile.velocity.replicate(2, 1);
  both.friction = pile.friction;
  both.friction.insert(both.friction.end(), pile.friction.begin(), pile.friction.end());
  for (const Model model : {Model::kConvex, Model::kCoulomb}) {
    const DenseSolution reference = Solve(pile, model, 1, 1e-8);
    ASSERT_EQ(reference.status, Status::kSolved);
    for (const double unit : {1e-7, 1e7}) {  // of impulses
      DenseProblem other = pile;
      other.delassus /= unit;
      const DenseSolution solution = Solve(other, model, 1, 1e-8);
      EXPECT_EQ(solution.status, Status::kSolved);
      EXPECT_LT(WorstMap(other, solution, model == Model::kCoulomb), 1.01e-7);
      if (model == Model::kConvex) ExpectNear(solution.velocities, reference.velocities, 1e-6);
    }
    const DenseSolution solution = Solve(both, model, 1, 1e-8);
    EXPECT_EQ(solution.status, Status::kSolved);
    EXPECT_LT(WorstMap(both, solution, model == Model::kCoulomb), 1.01e-7);
    if (model == Model::kConvex) ExpectNear(solution.velocities, reference.velocities.replicate(2, 1), 1e-6);
  }
}

// Two walls that close on a body: u_2 = -u_1 whatever the impulses, and both should be >= 0.
TEST(DenseSolver, TellsWhatHasNoSolution) {
  DenseProblem problem;
  problem.delassus = Eigen::MatrixXd::Zero(6, 6);
  problem.delassus.topLeftCorner(3, 3).setIdentity();
  problem.delassus.bottomRightCorner(3, 3).setIdentity();
  problem.delassus.topRightCorner(3, 3) = -Matrix3::Identity();
  problem.delassus.bottomLeftCorner(3, 3) = -Matrix3::Identity();
  problem.velocity = Vector3(-1, 0, 0).replicate(2, 1);
  problem.friction.assign(2, 0.5);
  for (const Model model : {Model::kConvex, Model::kCoulomb}) {
    const DenseSolution solution = Solve(problem, model);
    EXPECT_EQ(solution.status, Status::kInfeasible);
    EXPECT_TRUE(solution.impulses.allFinite());
  }
}

}  // namespace
}  // namespace islet::testing
