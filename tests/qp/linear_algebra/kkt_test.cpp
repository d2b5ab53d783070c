#include "qp/linear_algebra/kkt.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd DenseJacobian(const Problem& problem) {
  MatrixXd j = MatrixXd::Zero(3 * problem.num_contacts(), 6 * problem.num_bodies());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    if (contact.body_a >= 0) j.block(3 * c, 6 * contact.body_a, 3, 6) = contact.jacobian_a;
    if (contact.body_b >= 0) j.block(3 * c, 6 * contact.body_b, 3, 6) = contact.jacobian_b;
  }
  return j;
}

// The matrix of the header, field by field: [v of all bodies; p of all bodies].
MatrixXd DenseSystem(const Problem& problem, int fields, const std::vector<Matrix3>& d, const std::vector<double>& e) {
  const int n = 6 * problem.num_bodies(), nc = problem.num_contacts();
  MatrixXd mass = MatrixXd::Zero(n, n), inner = MatrixXd::Zero(3 * nc, 3 * nc), normal = inner;
  for (int i = 0; i < problem.num_bodies(); ++i) {
    mass.block<3, 3>(6 * i, 6 * i) = problem.bodies[i].mass * Matrix3::Identity();
    mass.block<3, 3>(6 * i + 3, 6 * i + 3) = problem.bodies[i].inertia;
  }
  for (int c = 0; c < nc; ++c) inner.block<3, 3>(3 * c, 3 * c) = d[c], normal(3 * c, 3 * c) = e[c];
  const MatrixXd j = DenseJacobian(problem);
  if (fields == 1) return mass + j.transpose() * inner * j;
  MatrixXd s(2 * n, 2 * n);
  s << mass + j.transpose() * normal * j, -mass, -mass, -j.transpose() * inner * j;
  return s;
}

void CheckAgainstDense(const Problem& problem, int fields, Random* random, qp::KktSystem* kkt) {
  std::vector<Matrix3> d;
  std::vector<double> e;
  for (const ContactTerm& contact : problem.contacts) {
    d.push_back(random->PositiveDefinite(0.1, 10));
    if (contact.friction == 0) d.back() = Vector3(d.back()(0, 0), 0, 0).asDiagonal();  // as the cone is then
    e.push_back(random->Uniform(0.1, 10));
  }
  kkt->Prepare(problem, fields);
  const int replaced = kkt->Factorise(d, e);
  const MatrixXd s = DenseSystem(problem, fields, d, e);
  const int n = 6 * problem.num_bodies();
  const VectorXd b = VectorXd::NullaryExpr(s.rows(), [&] { return random->Uniform(-1, 1); });
  const auto slot = [&](int i) { return 6 * fields * (i % n / 6) + 6 * (i / n) + i % 6; };
  std::vector<double> x(b.size());
  for (int i = 0; i < b.size(); ++i) x[slot(i)] = b[i];
  kkt->Solve(x.data());
  VectorXd y(b.size());
  for (int i = 0; i < b.size(); ++i) y[i] = x[slot(i)];
  const double residual = (s * y - b).norm() / (s.norm() * y.norm());
  EXPECT_EQ(replaced, 0);
  EXPECT_LT(residual, 1e-11);
}

TEST(Kkt, OneFieldAgreesWithDense) {
  Random random(41);
  qp::KktSystem kkt;
  for (const NamedProblem& island : RandomIslands(42, 30, 1e3, false)) {
    SCOPED_TRACE(island.name);
    CheckAgainstDense(island.problem, 1, &random, &kkt);
  }
}

// Also where the contacts leave J^T D J singular: -M in the corner makes every leading part quasi-definite.
TEST(Kkt, TwoFieldsAgreeWithDense) {
  Random random(43);
  qp::KktSystem kkt;
  for (const NamedProblem& island : RandomIslands(44, 30, 1e3, false)) {
    SCOPED_TRACE(island.name);
    CheckAgainstDense(island.problem, 2, &random, &kkt);
  }
}

TEST(Kkt, RepeatedUseAllocatesNothing) {
  Random random(46);
  qp::KktSystem kkt;
  const Problem problem = RandomCluster(&random, 8, 0.2, 0.8, 10);
  const std::vector<Matrix3> d(problem.contacts.size(), Matrix3::Identity());
  const std::vector<double> e(problem.contacts.size(), 1.0);
  std::vector<double> x(6 * problem.bodies.size(), 1.0);
  kkt.Prepare(problem, 1);
  const AllocationCounter counter;
  kkt.Prepare(problem, 1);
  kkt.Factorise(d, e);
  kkt.Solve(x.data());
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet::testing
