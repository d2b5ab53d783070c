#include "qp/dense/dense_gram.h"

#include <gtest/gtest.h>

#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

// Contacts in `groups` that do not feel each other: with many groups the factor is nearly all zeros.
qp::DenseProblem Groups(Random* random, int groups, int contacts) {
  qp::DenseProblem problem;
  const int size = 3 * contacts, n = groups * size;
  problem.delassus = Eigen::MatrixXd::Zero(n, n);
  for (int g = 0; g < groups; ++g) {
    Eigen::MatrixXd a(size, 6);
    for (int i = 0; i < a.size(); ++i) a.data()[i] = random->Uniform(-1, 1);
    problem.delassus.block(g * size, g * size, size, size) = a * a.transpose();
  }
  problem.velocity = Eigen::VectorXd::Ones(n);
  problem.friction.assign(groups * contacts, 0.5);
  return problem;
}

TEST(DenseGram, IsTheSumOverTheContacts) {
  Random random(2);
  for (const int groups : {1, 20}) {
    const qp::ScaledDenseProblem problem(Groups(&random, groups, 4), 1);
    std::vector<Matrix3> weights;
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(12 * groups, 12 * groups);
    for (int c = 0; c < 4 * groups; ++c) {
      weights.push_back(c % 3 == 0 ? Matrix3::Zero() : random.PositiveDefinite(0.1, 10));
      dense.block<3, 3>(3 * c, 3 * c) = weights.back();
    }
    const Eigen::MatrixXd start = Eigen::MatrixXd::Identity(6 * groups, 6 * groups);
    const Eigen::MatrixXd wanted = start + problem.factor.transpose() * dense * problem.factor;
    qp::DenseGram gram;
    gram.Prepare(problem);
    Eigen::MatrixXd sum = start;
    gram.Add(weights, &sum);
    EXPECT_LT((sum - wanted).cwiseAbs().maxCoeff(), 1e-12) << groups << " groups";
  }
}

}  // namespace
}  // namespace islet::testing
