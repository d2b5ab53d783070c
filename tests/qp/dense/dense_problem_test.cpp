#include "qp/dense/dense_problem.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <stdexcept>

#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

qp::DenseProblem TwoContacts() {
  qp::DenseProblem problem;
  problem.delassus = Eigen::VectorXd{{2, 3, 4, 5, 6, 7}}.asDiagonal();
  problem.delassus(0, 3) = problem.delassus(3, 0) = 1;
  problem.velocity = Eigen::VectorXd{{-1, 0.5, 0, -2, 0, 0}};
  problem.friction = {0.5, 0};
  return problem;
}

TEST(DenseProblem, NamesWhatIsWrong) {
  TwoContacts().Validate();
  const auto reason = [](const std::function<void(qp::DenseProblem*)>& spoil) {
    qp::DenseProblem problem = TwoContacts();
    spoil(&problem);
    try {
      problem.Validate();
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  using P = qp::DenseProblem*;
  EXPECT_NE(reason([](P p) { p->friction[1] = -0.5; }).find("contact 1: friction = -0.5"), std::string::npos);
  EXPECT_NE(reason([](P p) { p->friction[0] = NAN; }).find("contact 0: friction = nan"), std::string::npos);
  EXPECT_NE(reason([](P p) { p->velocity.resize(5); }).find("size of q = 5"), std::string::npos);
  EXPECT_NE(reason([](P p) { p->friction.push_back(1); }).find("rows of W = 6"), std::string::npos);
  EXPECT_NE(reason([](P p) { p->velocity[2] = NAN; }).find("sum of q = nan"), std::string::npos);
  EXPECT_NE(reason([](P p) { p->delassus(1, 2) = 0.25; }).find("W - W^T = 0.25"), std::string::npos);
  EXPECT_NE(reason([](P p) { p->delassus.row(0).setZero(), p->delassus.col(0).setZero(); }).find("contact 0: W_nn = 0"),
            std::string::npos);
  EXPECT_NE(reason([](P p) { p->delassus(4, 4) = -1; }).find("contact 1: diagonal entry of W = -1"), std::string::npos);
}

TEST(DenseProblem, ScaledIsTheSameProblemInOtherUnits) {
  const qp::DenseProblem problem = TwoContacts();
  const qp::ScaledDenseProblem scaled(problem, 2.5);
  const Eigen::VectorXd j_scaled{{0.3, 0.1, -0.2, 0.7, 0, 0}};
  Eigen::VectorXd j = j_scaled;
  for (int c = 0; c < 2; ++c) {
    EXPECT_NEAR(scaled.delassus.diagonal().segment<3>(3 * c).sum(), 3, 1e-14);
    j.segment<3>(3 * c) *= scaled.unit * scaled.scale[c];
  }
  const Eigen::VectorXd u = problem.delassus * j + problem.velocity;
  const Eigen::VectorXd u_scaled = scaled.delassus * j_scaled + scaled.velocity;
  for (int c = 0; c < 2; ++c)
    EXPECT_NEAR(u_scaled[3 * c] * scaled.RelativeSpeed(c), u[3 * c] / 2.5, 1e-14) << "contact " << c;
}

TEST(DenseProblem, FactorHasAsManyColumnsAsTheMatrixHasRank) {
  Random random(3);
  for (const double spread : {1.0, 1e-3, 1e-5}) {  // of the columns
    Eigen::MatrixXd a(60, 13);
    for (int i = 0; i < 60; ++i)
      for (int k = 0; k < 13; ++k) a(i, k) = random.Uniform(-1, 1) * std::pow(spread, k / 12.0);
    qp::DenseProblem problem;
    problem.delassus = a * a.transpose();
    problem.velocity = Eigen::VectorXd::Ones(60);
    problem.friction.assign(20, 0.5);
    const qp::ScaledDenseProblem scaled(problem, 1);
    EXPECT_EQ(scaled.factor.cols(), 13);
    EXPECT_LT((scaled.factor * scaled.factor.transpose() - scaled.delassus).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(DenseProblem, RefusesAnIndefiniteMatrix) {
  qp::DenseProblem problem = TwoContacts();
  problem.delassus(1, 2) = problem.delassus(2, 1) = 5;  // |5|^2 > 3 * 4
  problem.Validate();
  EXPECT_THROW(qp::ScaledDenseProblem(problem, 1), std::invalid_argument);
}

}  // namespace
}  // namespace islet::testing
