#include "qp/direct/one_contact.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

double Condition(const Matrix3& w) {
  const Vector3 values = Eigen::SelfAdjointEigenSolver<Matrix3>(w).eigenvalues();
  return values[2] / values[0];
}

// Signorini-Coulomb, straight from its cases. Largest violation, relative to the size of q.
double Violation(const Matrix3& w, const Vector3& q, double mu, const Vector3& j) {
  const Vector3 u = w * j + q;
  const double size = q.norm(), impulse = std::max(j.norm(), 1e-300);
  if (j.norm() == 0) return std::max(0.0, -u[0]) / size;
  const double jt = j.tail<2>().norm(), ut = u.tail<2>().norm();
  double worst = std::max(std::abs(u[0]) / size, std::max(0.0, jt - mu * j[0]) / impulse);
  if (jt < (1 - 1e-9) * mu * j[0]) return std::max(worst, ut / size);                       // inside: sticks
  return std::max(worst, (ut * j.tail<2>() + jt * u.tail<2>()).norm() / (size * impulse));  // on it: opposes slip
}

// All sliding answers, by scanning the direction of friction.
std::vector<Vector3> ScanSliding(const Matrix3& w, const Vector3& q, double mu) {
  struct Point {
    Vector3 j, u;
    double cross;
  };
  const auto at = [&](double angle) {
    const Vector3 d(1, mu * std::cos(angle), mu * std::sin(angle));
    const Vector3 j = -q[0] / w.row(0).dot(d) * d;
    const Vector3 u = w * j + q;
    return Point{j, u, u[1] * std::sin(angle) - u[2] * std::cos(angle)};
  };
  std::vector<Vector3> found;
  constexpr int kSteps = 2000;
  const double pi = std::numbers::pi;
  for (int i = 0; i < kSteps; ++i) {
    double low = 2 * pi * i / kSteps, high = 2 * pi * (i + 1) / kSteps;
    if (at(low).cross * at(high).cross > 0) continue;
    for (int halving = 0; halving < 60; ++halving) {
      const double middle = 0.5 * (low + high);
      (at(low).cross * at(middle).cross <= 0 ? high : low) = middle;
    }
    const Point p = at(low);
    if (p.j[0] > 0 && p.u.tail<2>().dot(p.j.tail<2>()) < 0 && std::abs(p.cross) < 1e-9) found.push_back(p.j);
  }
  return found;
}

Matrix3 DelassusOfRod(Random* random, double reach) {
  // A body with long levers: strong coupling between normal and tangents, the stuff of Painleve's paradox.
  ProblemBuilder builder;
  builder.AddBody(random->Vector(reach), 1, random->PositiveDefinite(0.01, 0.3));
  builder.AddContact(-1, 0, Vector3::Zero(), random->Direction(), 1);
  return qp::DelassusBlock(builder.problem, builder.problem.contacts[0]);
}

TEST(OneContact, SeparatesSticksAndSlidesByHand) {
  const qp::OneContact contact(Matrix3::Identity());
  EXPECT_EQ(contact.SolveCoulomb({0, 3, 4}, 0.5), Vector3(0, 0, 0));
  EXPECT_EQ(contact.SolveCoulomb({1, 3, 4}, 0.5), Vector3(0, 0, 0));
  EXPECT_LT((contact.SolveCoulomb({-2, 0.3, 0.4}, 0.5) - Vector3(2, -0.3, -0.4)).norm(), 1e-14);
  EXPECT_LT((contact.SolveCoulomb({-2, 3, 4}, 0.5) - Vector3(2, -0.6, -0.8)).norm(), 1e-14);
  EXPECT_LT((contact.SolveCoulomb({-2, 3, 4}, 0) - Vector3(2, 0, 0)).norm(), 1e-14);
}

TEST(OneContact, FulfilsTheLawAndIsAmongTheScannedAnswers) {
  Random random(61);
  int sticks = 0, slides = 0, separates = 0;
  for (int trial = 0; trial < 600; ++trial) {
    const Matrix3 w = trial % 2 ? random.PositiveDefinite(0.2, 5) : DelassusOfRod(&random, 1);
    const Vector3 q = random.Vector(1);
    const double mu = random.Uniform(0, 1.2);
    const Vector3 j = qp::OneContact(w).SolveCoulomb(q, mu);
    EXPECT_LT(Violation(w, q, mu, j), 1e-14 * Condition(w) * Condition(w) + 1e-13) << "trial " << trial;
    if (j.norm() == 0) {
      ++separates;
      EXPECT_GE(q[0], 0);
    } else if (j.tail<2>().norm() < 0.999999 * mu * j[0]) {
      ++sticks;
    } else {
      ++slides;
      double nearest = 1e300;
      for (const Vector3& other : ScanSliding(w, q, mu)) nearest = std::min(nearest, (other - j).norm());
      EXPECT_LT(nearest, 1e-6 * j.norm()) << "trial " << trial;
    }
  }
  EXPECT_GT(sticks, 30);
  EXPECT_GT(slides, 50);
  EXPECT_GT(separates, 50);
}

TEST(OneContact, HasAnAnswerUnderPainleve) {
  Random random(62);
  int paradox = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Matrix3 w = DelassusOfRod(&random, 5);
    Vector3 q = random.Vector(1);
    q[0] = -std::abs(q[0]);
    const double mu = random.Uniform(0.5, 10);
    if (mu * w.row(0).tail<2>().norm() > w(0, 0)) ++paradox;
    const Vector3 j = qp::OneContact(w).SolveCoulomb(q, mu);
    ASSERT_TRUE(j.allFinite());
    EXPECT_GT(j[0], 0);
    EXPECT_LT(Violation(w, q, mu, j), 1e-14 * Condition(w) * Condition(w) + 1e-13) << "trial " << trial << " mu " << mu;
  }
  EXPECT_GT(paradox, 500);
}

// u in K*, j in K, and perpendicular: by hand, then for all there is.
TEST(OneContact, ConvexModel) {
  Vector3 j;
  const qp::OneContact unit(Matrix3::Identity());
  ASSERT_TRUE(unit.SolveConvex({2, 3, 0}, 0.5, &j));
  EXPECT_EQ(j, Vector3(0, 0, 0));
  ASSERT_TRUE(unit.SolveConvex({-2, 0.3, 0.4}, 0.5, &j));
  EXPECT_LT((j - Vector3(2, -0.3, -0.4)).norm(), 1e-13);
  ASSERT_TRUE(
      unit.SolveConvex({-2, 3, 4}, 0.75, &j));  // the nearest point of the cone to (2, -3, -4): its edge is (4, 3) / 5
  EXPECT_LT((j - (2 * 0.8 + 5 * 0.6) * Vector3(0.8, -0.36, -0.48)).norm(), 1e-13);
  Random random(65);
  int slides = 0, missed = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const Matrix3 w = trial % 2 ? random.PositiveDefinite(0.2, 5) : DelassusOfRod(&random, 2);
    const Vector3 q = random.Vector(1);
    const double mu = random.Uniform(0, 1.2);
    if (!qp::OneContact(w).SolveConvex(q, mu, &j)) {
      ++missed;
      continue;
    }
    const Vector3 u = w * j + q;
    const double accuracy = 1e-13 * Condition(w) * q.norm();
    EXPECT_GE(u[0] - mu * u.tail<2>().norm(), -accuracy) << trial;
    EXPECT_LE(j.tail<2>().norm(), mu * j[0] * (1 + 1e-12)) << trial;
    EXPECT_LE(std::abs(u.dot(j)), accuracy * j.norm()) << trial;
    slides += j.norm() > 0 && j.tail<2>().norm() > 0.999999 * mu * j[0];
  }
  EXPECT_GT(slides, 1000);
  EXPECT_LT(missed, 60);  // 32, under the paradox
}

// The least energy with u_n >= target, by hand: inside the cone, on its edge, and where friction lifts by more than the target.
TEST(OneContact, KineticModelByHand) {
  Vector3 j;
  double multiplier;
  const qp::OneContact unit(Matrix3::Identity());
  ASSERT_TRUE(unit.SolveKinetic({-2, 0.3, 0.4}, 0.5, 1, &j, &multiplier));
  EXPECT_LT((j - Vector3(3, -0.3, -0.4)).norm(), 1e-14);
  EXPECT_NEAR(multiplier, 1, 1e-14);
  ASSERT_TRUE(unit.SolveKinetic({-2, 3, 4}, 0.5, 3, &j, &multiplier));
  EXPECT_LT((j - Vector3(5, -1.5, -2)).norm(), 1e-13);
  EXPECT_NEAR(multiplier, 1.75, 1e-13);
  ASSERT_TRUE(unit.SolveKinetic({-2, 3, 4}, 0.5, 1, &j, &multiplier));
  EXPECT_LT((j - 3.6 * Vector3(1, -0.3, -0.4)).norm(), 1e-12);
  EXPECT_EQ(multiplier, 0);
  ASSERT_TRUE(unit.SolveKinetic({-2, 3, 4}, 0, 1, &j, &multiplier));
  EXPECT_LT((j - Vector3(3, 0, 0)).norm(), 1e-14);
}

// u - multiplier W n in K*, j in K, perpendicular; u_n = target where there is a multiplier.
TEST(OneContact, KineticModelFulfilsItsConditions) {
  Random random(66);
  int edges = 0, slack = 0, missed = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const Matrix3 w = trial % 2 ? random.PositiveDefinite(0.2, 5) : DelassusOfRod(&random, 1);
    Vector3 q = random.Vector(1), j;
    q[0] = -std::abs(q[0]);
    const double mu = random.Uniform(0, 1.2), target = -random.Uniform(0.01, 1) * q[0];
    double multiplier;
    if (!qp::OneContact(w).SolveKinetic(q, mu, target, &j, &multiplier)) {
      ++missed;
      continue;
    }
    const Vector3 u = w * j + q, dual = u - multiplier * w.col(0);
    const double accuracy = 1e-11 * Condition(w) * q.norm();
    EXPECT_GE(multiplier, 0);
    EXPECT_GE(u[0], target - accuracy) << trial;
    EXPECT_LE(multiplier * (u[0] - target), accuracy * multiplier) << trial;
    EXPECT_GE(dual[0] - mu * dual.tail<2>().norm(), -accuracy) << trial;
    EXPECT_LE(j.tail<2>().norm(), mu * j[0] * (1 + 1e-12)) << trial;
    EXPECT_LE(std::abs(dual.dot(j)), accuracy * j.norm()) << trial;
    edges += multiplier > 0 && j.tail<2>().norm() > 0.999999 * mu * j[0];
    slack += multiplier == 0;
  }
  EXPECT_GT(edges, 300);
  EXPECT_GT(slack, 100);
  EXPECT_LT(missed, 60);
}

TEST(OneContact, NeverRaisesEnergy) {
  Random random(63);
  for (int trial = 0; trial < 2000; ++trial) {
    const Matrix3 w = DelassusOfRod(&random, 3);
    const Vector3 q = random.Vector(1), j = qp::OneContact(w).SolveCoulomb(q, random.Uniform(0, 3));
    EXPECT_LE(j.dot(q) + 0.5 * j.dot(w * j), 1e-12 * (1 + j.norm()));
  }
}

TEST(OneContact, DoesNotCareHowTheTangentsAreTurned) {
  Random random(64);
  for (int trial = 0; trial < 500; ++trial) {
    const Matrix3 w = DelassusOfRod(&random, 2);
    const Vector3 q = random.Vector(1);
    const double mu = random.Uniform(0, 2), angle = random.Uniform(0, 7);
    Matrix3 turn = Matrix3::Identity();
    turn(1, 1) = turn(2, 2) = std::cos(angle), turn(2, 1) = std::sin(angle), turn(1, 2) = -std::sin(angle);
    Matrix3 turned = turn * w * turn.transpose();
    turned = (0.5 * (turned + turned.transpose())).eval();
    const Vector3 j = qp::OneContact(w).SolveCoulomb(q, mu);
    EXPECT_LT((qp::OneContact(turned).SolveCoulomb(turn * q, mu) - turn * j).norm(),
              1e-12 * Condition(w) * j.norm() + 1e-300);
  }
}

TEST(OneContact, ScalesWithVelocityAndMass) {
  Random random(65);
  for (int trial = 0; trial < 200; ++trial) {
    const Matrix3 w = DelassusOfRod(&random, 2);
    const Vector3 q = random.Vector(1);
    const double mu = random.Uniform(0, 2);
    const Vector3 j = qp::OneContact(w).SolveCoulomb(q, mu);
    EXPECT_LT((qp::OneContact(1e-6 * w).SolveCoulomb(1e-3 * q, mu) - 1e3 * j).norm(), 1e-7 * (1 + 1e3 * j.norm()));
  }
}

}  // namespace
}  // namespace islet::testing
