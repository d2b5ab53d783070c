#include "qp/dense/dense_newton.h"

#include <gtest/gtest.h>

#include <cmath>

namespace islet::testing {
namespace {

using qp::DenseProblem;
using qp::Model;

// Three contacts with full rank: one sticks, one slides, one opens.
DenseProblem ThreeContacts() {
  DenseProblem problem;
  problem.delassus = Eigen::MatrixXd::Identity(9, 9);
  for (int i = 0; i + 1 < 9; ++i) problem.delassus(i, i + 1) = problem.delassus(i + 1, i) = 0.2;
  problem.velocity = Eigen::VectorXd{{-1, 0.1, 0.1, -1, 2, 1, 1, 0.5, 0}};
  problem.friction = {0.6, 0.4, 0.5};
  return problem;
}

TEST(DenseNewton, FinishesFromNearby) {
  const qp::ScaledDenseProblem problem(ThreeContacts(), 1);
  for (const Model model : {Model::kConvex, Model::kCoulomb}) {
    qp::DenseNewton newton;
    Eigen::VectorXd answer = Eigen::VectorXd::Zero(9);
    newton.Polish(problem, model, 1e-10, 100, &answer);
    EXPECT_TRUE(qp::NaturalMapOf(problem, model, answer).Meets(1e-10));
    Eigen::VectorXd near = answer + 1e-4 * Eigen::VectorXd::Ones(9);
    const int steps = newton.Polish(problem, model, 1e-10, 100, &near);
    EXPECT_GT(steps, 0);
    EXPECT_LT(steps, 25);
    EXPECT_LT((near - answer).cwiseAbs().maxCoeff(), 1e-8);
    EXPECT_EQ(newton.Polish(problem, model, 1e-10, 100, &near), 0);  // nothing is left to do
  }
}

// The map of a sticking, a sliding and an open contact by hand, W = 1 so that the scaled units are those of the problem.
TEST(DenseNewton, NaturalMapByHand) {
  DenseProblem one;
  one.delassus = Eigen::MatrixXd::Identity(3, 3);
  one.velocity = Eigen::Vector3d(-1, 3, 4);
  one.friction = {0.5};
  const qp::ScaledDenseProblem problem(one, 1);
  EXPECT_NEAR(qp::NaturalMapOf(problem, Model::kCoulomb, Eigen::Vector3d(1, -0.3, -0.4)).max, 0, 1e-14);
  // Without impulse u = q: what is projected is (1 - 2.5, -3, -4), which lies 1/1.25 (-1.5 + 2.5) along (1, 0.5).
  EXPECT_NEAR(qp::NaturalMapOf(problem, Model::kCoulomb, Eigen::Vector3d::Zero()).max, 0.8 * std::hypot(1, 0.5), 1e-14);
  EXPECT_NEAR(qp::NaturalMapOf(problem, Model::kConvex, Eigen::Vector3d::Zero()).max, 2.8 * std::hypot(1, 0.5), 1e-14);
}

// Redundant contacts: the matrix of Newton's method is regular all the same.
TEST(DenseNewton, RankOne) {
  DenseProblem redundant;
  redundant.delassus = Eigen::Matrix3d::Identity().replicate(3, 3);
  redundant.velocity = Eigen::Vector3d(-1, 3, 4).replicate(3, 1);
  redundant.friction.assign(3, 0.5);
  const qp::ScaledDenseProblem problem(redundant, 1);
  EXPECT_EQ(problem.factor.cols(), 3);
  Eigen::VectorXd impulses = Eigen::VectorXd::Zero(9);
  qp::DenseNewton newton;
  newton.Polish(problem, Model::kCoulomb, 1e-12, 100, &impulses);
  EXPECT_LT(qp::NaturalMapOf(problem, Model::kCoulomb, impulses).max, 1e-11);
}

}  // namespace
}  // namespace islet::testing
