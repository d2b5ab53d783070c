#include "qp/direct/octagon_contact.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "tests/support/solve.h"

namespace islet::testing {
namespace {

using qp::Cone;
using qp::Model;

double Condition(const Matrix3& w) {
  const Vector3 values = Eigen::SelfAdjointEigenSolver<Matrix3>(w).eigenvalues();
  return values[2] / values[0];
}

Vector3 Generator(int k, double mu) {
  const double angle = (k + 0.5) * std::numbers::pi / 4;
  return {1, mu * std::cos(angle), mu * std::sin(angle)};
}

double OutsideDual(const Vector3& u, double mu) {
  double worst = 0;
  for (int k = 0; k < 8; ++k) worst = std::max(worst, -Generator(k, mu).dot(u));
  return worst;
}

// Left of a facet's plane: the normal points out of two generators that follow each other.
double OutsideCone(const Vector3& j, double mu) {
  double worst = 0;
  for (int k = 0; k < 8; ++k)
    worst = std::max(worst, -Generator(k, mu).cross(Generator(k + 1, mu)).normalized().dot(j));
  return worst;
}

struct Faces {
  int none = 0, inside = 0, facet = 0, edge = 0;
  void Count(const Vector3& j, double mu) {
    if (j.isZero(0)) {
      ++none;
      return;
    }
    int on = 0;
    for (int k = 0; k < 8; ++k)
      on += Generator(k, mu).cross(Generator(k + 1, mu)).normalized().dot(j) < 1e-9 * j.norm();
    ++(on == 0 ? inside : on == 1 ? facet : edge);
  }
};

TEST(OctagonContact, ByHand) {
  const double mu = 0.5, edge = std::cos(std::numbers::pi / 8);
  const qp::OctagonContact unit(Matrix3::Identity(), mu);
  Vector3 j;
  double multiplier;
  // Sticks.
  ASSERT_TRUE(unit.SolveCoulomb({-2, 0.3, 0.4}, &j));
  EXPECT_LT((j - Vector3(2, -0.3, -0.4)).norm(), 1e-14);
  ASSERT_TRUE(unit.SolveConvex({-2, 0.3, 0.4}, &j));
  EXPECT_LT((j - Vector3(2, -0.3, -0.4)).norm(), 1e-14);
  // Slides against a facet: |j_t| is mu j_n cos(pi / 8) there.
  ASSERT_TRUE(unit.SolveCoulomb({-2, 5, 0}, &j));
  EXPECT_LT((j - Vector3(2, -2 * mu * edge, 0)).norm(), 1e-14);
  // Slides against an edge.
  ASSERT_TRUE(unit.SolveCoulomb({-2, 5 * edge, 5 * std::sin(std::numbers::pi / 8)}, &j));
  EXPECT_LT((j - 2 * Vector3(1, -mu * edge, -mu * std::sin(std::numbers::pi / 8))).norm(), 1e-14);
  // The convex model's: the nearest point of the cone to -q.
  ASSERT_TRUE(unit.SolveConvex({-2, 5, 0}, &j));
  EXPECT_LT((j - (2 + 5 * mu * edge) / (1 + mu * edge * mu * edge) * Vector3(1, -mu * edge, 0)).norm(), 1e-13);
  // Opens, with and without friction that holds it.
  ASSERT_TRUE(unit.SolveCoulomb({0.1, 3, 0}, &j));
  EXPECT_EQ(j, Vector3(0, 0, 0));
  ASSERT_TRUE(unit.SolveConvex({2, 3, 0}, &j));
  EXPECT_EQ(j, Vector3(0, 0, 0));
  // Bounces: friction stops the slip, the multiplier is that of u_n.
  ASSERT_TRUE(unit.SolveKinetic({-2, 0.3, 0.4}, 1, &j, &multiplier));
  EXPECT_LT((j - Vector3(3, -0.3, -0.4)).norm(), 1e-14);
  EXPECT_NEAR(multiplier, 1, 1e-14);
}

TEST(OctagonContact, AllModelsFulfilTheirConditions) {
  Random random(71);
  Faces convex, coulomb, kinetic;
  int missed = 0, slack = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    SCOPED_TRACE(trial);
    const Matrix3 w = random.PositiveDefinite(0.2, 5);
    const Vector3 q = random.Vector(1);
    const double mu = random.Uniform(0.05, 1.2), target = random.Uniform(0, 1), small = 1e-11 * Condition(w) * q.norm();
    const qp::OctagonContact law(w, mu);
    const auto judge = [&](const Vector3& j, const Vector3& dual) {
      EXPECT_LE(OutsideCone(j, mu), small);
      EXPECT_LE(OutsideDual(dual, mu), small);
      EXPECT_LE(std::abs(j.dot(dual)), small * j.norm());
    };
    Vector3 j;
    ASSERT_TRUE(law.SolveConvex(q, &j));
    judge(j, w * j + q);
    convex.Count(j, mu);
    double multiplier;
    ASSERT_TRUE(law.SolveKinetic(q, target, &j, &multiplier));
    judge(j, w * (j - multiplier * Vector3::UnitX()) + q);
    const double excess = w.row(0).dot(j) + q[0] - target;
    EXPECT_GE(multiplier, 0);
    EXPECT_GE(excess, -small);
    EXPECT_LE(multiplier * excess, small * multiplier);
    slack += multiplier == 0;
    kinetic.Count(j, mu);
    if (!law.SolveCoulomb(q, &j)) {
      ++missed;
      continue;
    }
    Vector3 u = w * j + q;
    EXPECT_GE(u[0], -small);
    EXPECT_LE(std::abs(j[0] * u[0]), small * j.norm());
    u[0] += OutsideDual(Vector3(0, u[1], u[2]), mu);  // mu times the support of -u_t
    judge(j, u);
    coulomb.Count(j, mu);
  }
  for (const Faces& faces : {convex, coulomb, kinetic}) {
    EXPECT_GT(faces.none, 50);
    EXPECT_GT(faces.inside, 50);
    EXPECT_GT(faces.facet, 50);
    EXPECT_GT(faces.edge, 50);
  }
  EXPECT_GT(slack, 300);
  EXPECT_LT(missed, 30);
}

// Faint approaches in fast slides, hardly any friction, targets that friction all but reaches by itself: what is answered is right,
// and little is not.
TEST(OctagonContact, AtTheBorders) {
  Random random(73);
  int answered = 0, all = 0;
  for (int decade = 0; decade >= -14; --decade) {
    for (int trial = 0; trial < 20; ++trial) {
      SCOPED_TRACE(std::to_string(decade) + " " + std::to_string(trial));
      const double little = std::pow(10.0, decade), mu = trial % 2 == 0 ? 0.5 : little;
      const Matrix3 w = random.PositiveDefinite(0.2, 5);
      Vector3 q = random.Vector(1), j;
      q[0] = trial % 3 == 0 ? -little : trial % 3 == 1 ? little : -std::abs(q[0]);
      const qp::OctagonContact law(w, mu);
      const double small = 1e-11 * Condition(w) * q.norm();
      const auto judge = [&](bool solved, const Vector3& dual) {
        ++all;
        if (!solved) return;
        ++answered;
        EXPECT_LE(OutsideCone(j, mu), small);
        EXPECT_LE(OutsideDual(dual, mu), small);
        EXPECT_LE(std::abs(j.dot(dual)), small * j.norm());
      };
      const bool convex = law.SolveConvex(q, &j);
      judge(convex, w * j + q);
      const double lifted = w.row(0).dot(j) + q[0], target = lifted * (1 + (trial % 4 < 2 ? little : -little));
      const bool coulomb = law.SolveCoulomb(q, &j);
      Vector3 u = w * j + q;
      u[0] += OutsideDual(Vector3(0, u[1], u[2]), mu);
      judge(coulomb, u);
      double multiplier;
      if (!convex || target <= 0) continue;
      const bool kinetic = law.SolveKinetic(q, target, &j, &multiplier);
      judge(kinetic, w * (j - multiplier * Vector3::UnitX()) + q);
      EXPECT_TRUE(!kinetic || w.row(0).dot(j) + q[0] >= target - small);
    }
  }
  EXPECT_GT(answered, 0.95 * all);
}

// One contact between two bodies, by the formula and by the interior point.
TEST(OctagonContact, IsWhatTheInteriorPointFinds) {
  Random random(72);
  for (int trial = 0; trial < 100; ++trial) {
    for (const Cone cone : {Cone::kOctagon, Cone::kCircular}) {
      for (const Model model : {Model::kKinetic, Model::kConvex, Model::kCoulomb}) {
        SCOPED_TRACE(std::to_string(trial) + " " + std::to_string(static_cast<int>(model)));
        Problem problem = RandomChain(&random, 1, 0, 1.5, 1);
        if (trial % 2) SetBounces(0.5, &problem);
        qp::Settings settings = MakeSettings(problem, model, cone);
        const qp::Solution formula = Solve(problem, settings);
        EXPECT_EQ(formula.rung, qp::Rung::kClosedForm);
        settings.ladder = qp::Ladder::Off();
        settings.aim = 1e-13;
        settings.effort = qp::kThoroughEffort;
        settings.tolerance = 1e-8;
        const qp::Solution rounds = Solve(problem, settings);
        EXPECT_EQ(rounds.rung, qp::Rung::kInteriorPoint);
        EXPECT_LT(VelocityDistance(problem, rounds.velocities, formula.velocities), 1e-5 * settings.velocity_scale);
      }
    }
  }
}

}  // namespace
}  // namespace islet::testing
