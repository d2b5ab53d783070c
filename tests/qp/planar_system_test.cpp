#include "qp/planar_system.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "tests/support/no_alloc.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kAlive[3] = {0, 1, 5};  // components of a velocity in the plane

MatrixXd DenseSystem(const Problem& problem, double mass_scale, const std::vector<Matrix3>& d) {
  const int n = 3 * problem.num_bodies();
  MatrixXd s = MatrixXd::Zero(n, n);
  for (int i = 0; i < problem.num_bodies(); ++i)
    s.block<3, 3>(3 * i, 3 * i) =
        mass_scale *
        Vector3(problem.bodies[i].mass, problem.bodies[i].mass, problem.bodies[i].inertia(2, 2)).asDiagonal();
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    MatrixXd j = MatrixXd::Zero(2, n);
    for (int r = 0; r < 2; ++r) {
      for (int k = 0; k < 3; ++k) {
        if (contact.body_a >= 0) j(r, 3 * contact.body_a + k) = contact.jacobian_a(r, kAlive[k]);
        if (contact.body_b >= 0) j(r, 3 * contact.body_b + k) = contact.jacobian_b(r, kAlive[k]);
      }
    }
    s += j.transpose() * d[c].topLeftCorner<2, 2>() * j;
  }
  return s;
}

TEST(PlanarSystem, AgreesWithDense) {
  Random random(47);
  qp::PlanarSystem system;
  for (const NamedProblem& island : RandomIslands(48, 40, 1e3, false)) {
    SCOPED_TRACE(island.name);
    const Problem& problem = island.problem;
    std::vector<Matrix3> d;
    for (int c = 0; c < problem.num_contacts(); ++c) d.push_back(random.PositiveDefinite(0.1, 10));
    const MatrixXd s = DenseSystem(problem, 0.3, d);
    const VectorXd b = VectorXd::NullaryExpr(s.rows(), [&] { return random.Uniform(-1, 1); });
    for (int pass = 0; pass < 2; ++pass) {
      const AllocationCounter counter;
      system.Prepare(problem, 0.3);
      EXPECT_EQ(system.Factorise(d), 0);
      if (pass == 1) {
        EXPECT_EQ(counter.count(), 0);
      }
    }
    VectorXd x = b;
    system.Solve(x.data());
    EXPECT_LT((s * x - b).norm(), 1e-11 * s.norm() * x.norm());
  }
}

}  // namespace
}  // namespace islet::testing
