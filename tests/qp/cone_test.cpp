#include "qp/cone.h"

#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/cone_algebra.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::ConeKind;
using qp::ContactCone;
using Rows = std::array<double, qp::kMaxRows>;

double Dot(ConeKind kind, const Rows& a, const Rows& b) {
  double sum = 0;
  for (int i = 0; i < qp::NumRows(kind); ++i) sum += a[i] * b[i];
  return sum;
}

Rows RandomInside(Random* random, ConeKind kind) {
  Rows x{};
  for (int i = 0; i < qp::NumRows(kind); ++i) x[i] = random->Uniform(0.01, 1);
  if (kind == ConeKind::kCircular) {
    x[1] -= 0.5, x[2] -= 0.5;
    x[0] = std::hypot(x[1], x[2]) + std::pow(10, random->Uniform(-4, 1));
  }
  return x;
}

Rows RandomAnywhere(Random* random) {
  Rows x{};
  for (double& value : x) value = random->Uniform(-1, 1);
  return x;
}

// Inward normal of facet h, word for word [SM04 Eq. 8].
Vector3 Facet(int h, double mu) {
  const double pi = std::numbers::pi;
  return {mu * std::cos(pi / 8), std::cos(pi * h / 4), std::sin(pi * h / 4)};
}

class ConeOfKind : public ::testing::TestWithParam<ConeKind> {
 protected:
  void Draw() {
    cone_ = {GetParam(), GetParam() == ConeKind::kRay ? 0 : random_.Uniform(0.05, 2)};
    s_ = RandomInside(&random_, GetParam());
    z_ = RandomInside(&random_, GetParam());
    scaling_ = {point_.data(), lambda_.data(), 0};
    ASSERT_TRUE(qp::UpdateScaling(GetParam(), s_.data(), z_.data(), &scaling_));
  }
  void ExpectSame(const Rows& a, const Rows& b, double tolerance) {
    for (int i = 0; i < qp::NumRows(GetParam()); ++i) EXPECT_NEAR(a[i], b[i], tolerance * (1 + std::abs(b[i])));
  }
  Random random_{51};
  ContactCone cone_;
  Rows s_{}, z_{}, point_{}, lambda_{};
  qp::Scaling scaling_{};
};

TEST_P(ConeOfKind, ScalingMeetsInLambda) {
  for (int trial = 0; trial < 300; ++trial) {
    Draw();
    Rows out{};
    qp::ApplyScaling(GetParam(), scaling_, z_.data(), out.data());
    ExpectSame(out, lambda_, 1e-12);
    qp::ApplyInverseScaling(GetParam(), scaling_, s_.data(), out.data());
    ExpectSame(out, lambda_, 1e-9);
    EXPECT_NEAR(Dot(GetParam(), lambda_, lambda_), Dot(GetParam(), s_, z_), 1e-10 * (1 + Dot(GetParam(), s_, z_)));
  }
}

TEST_P(ConeOfKind, ScalingIsSymmetricAndInvertible) {
  for (int trial = 0; trial < 100; ++trial) {
    Draw();
    const Rows x = RandomAnywhere(&random_), y = RandomAnywhere(&random_);
    Rows wx{}, wy{}, back{};
    qp::ApplyScaling(GetParam(), scaling_, x.data(), wx.data());
    qp::ApplyScaling(GetParam(), scaling_, y.data(), wy.data());
    EXPECT_NEAR(Dot(GetParam(), wx, y), Dot(GetParam(), x, wy), 1e-11 * (1 + std::abs(Dot(GetParam(), wx, y))));
    qp::ApplyInverseScaling(GetParam(), scaling_, wx.data(), back.data());
    const double size = 1 + std::sqrt(Dot(GetParam(), wx, wx) * Dot(GetParam(), point_, point_)) / scaling_.eta;
    ExpectSame(back, x, 1e-12 * size * size);
    qp::ApplyScaling(GetParam(), scaling_, wx.data(), wx.data());  // in place is allowed
    EXPECT_TRUE(std::isfinite(wx[0]));
  }
}

TEST_P(ConeOfKind, ScalingBlockIsThatOfTheRows) {
  for (int trial = 0; trial < 100; ++trial) {
    Draw();
    const Matrix3 d = qp::ScalingBlock(cone_, scaling_);
    Matrix3 expected;
    for (int i = 0; i < 3; ++i) {
      Rows rows{};
      qp::MapToRows(cone_, Vector3::Unit(i), rows.data());
      qp::ApplyInverseScaling(GetParam(), scaling_, rows.data(), rows.data());
      qp::ApplyInverseScaling(GetParam(), scaling_, rows.data(), rows.data());
      expected.col(i) = qp::MapFromRows(cone_, rows.data());
    }
    EXPECT_LT((d - expected).norm(), 1e-9 * d.norm());
    EXPECT_LT((d - d.transpose()).norm(), 1e-15 * d.norm());
    const Vector3 x = random_.Direction();
    EXPECT_GE(x.dot(d * x), GetParam() == ConeKind::kRay ? 0 : -1e-15 * d.norm());
    EXPECT_GT(d(0, 0), 0);
  }
}

TEST_P(ConeOfKind, MapsAreAdjoint) {
  Draw();
  const Vector3 w = random_.Vector(1);
  const Rows z = RandomAnywhere(&random_);
  Rows s{};
  qp::MapToRows(cone_, w, s.data());
  EXPECT_NEAR(Dot(GetParam(), z, s), qp::MapFromRows(cone_, z.data()).dot(w), 1e-14);
}

TEST_P(ConeOfKind, JordanAlgebra) {
  for (int trial = 0; trial < 100; ++trial) {
    Draw();
    const Rows x = RandomAnywhere(&random_);
    Rows unit{}, out{}, other{};
    qp::Identity(GetParam(), unit.data());
    qp::JordanProduct(GetParam(), unit.data(), x.data(), out.data());
    ExpectSame(out, x, 1e-15);
    qp::JordanProduct(GetParam(), lambda_.data(), x.data(), out.data());
    qp::JordanProduct(GetParam(), x.data(), lambda_.data(), other.data());
    ExpectSame(out, other, 1e-15);
    const double condition = lambda_[0] / std::max(1e-300, qp::MinEigenvalue(GetParam(), lambda_.data()));
    qp::JordanDivide(GetParam(), lambda_.data(), out.data(), out.data());
    ExpectSame(out, x, 1e-13 * (1 + std::abs(condition)));
    EXPECT_EQ(qp::Degree(GetParam()), GetParam() == ConeKind::kOctagon ? 8 : 1);
  }
}

TEST_P(ConeOfKind, MaxStepEndsOnTheBoundary) {
  int reached = 0;
  for (int trial = 0; trial < 500; ++trial) {
    Draw();
    const Rows direction = RandomAnywhere(&random_);
    const double limit = random_.Uniform(0.1, 20);
    const double step = qp::MaxStep(GetParam(), lambda_.data(), direction.data(), limit);
    ASSERT_GE(step, 0);
    ASSERT_LE(step, limit);
    const auto margin = [&](double t) {
      Rows x{};
      for (int i = 0; i < qp::NumRows(GetParam()); ++i) x[i] = lambda_[i] + t * direction[i];
      return qp::MinEigenvalue(GetParam(), x.data());
    };
    const double size = lambda_[0] + step;
    EXPECT_GT(margin(0.999 * step), 0);
    if (step < limit) {
      ++reached;
      EXPECT_NEAR(margin(step), 0, 1e-10 * size);
      EXPECT_LT(margin(1.001 * step + 1e-9), 0);
    }
  }
  EXPECT_GT(reached, 100);
}

TEST_P(ConeOfKind, PointsOutsideAreRefused) {
  Draw();
  Rows bad = s_;
  bad[0] = -1;
  EXPECT_FALSE(qp::UpdateScaling(GetParam(), bad.data(), z_.data(), &scaling_));
  EXPECT_FALSE(qp::UpdateScaling(GetParam(), s_.data(), bad.data(), &scaling_));
  bad[0] = std::nan("");
  EXPECT_FALSE(qp::UpdateScaling(GetParam(), s_.data(), bad.data(), &scaling_));
}

INSTANTIATE_TEST_SUITE_P(Kinds, ConeOfKind, ::testing::Values(ConeKind::kRay, ConeKind::kCircular, ConeKind::kOctagon));

TEST(Cone, Choice) {
  EXPECT_EQ(qp::ChooseCone(0, qp::Cone::kCircular).kind, ConeKind::kRay);
  EXPECT_EQ(qp::ChooseCone(1e-13, qp::Cone::kOctagon).kind, ConeKind::kRay);
  EXPECT_EQ(qp::ChooseCone(0.5, qp::Cone::kCircular).kind, ConeKind::kCircular);
  EXPECT_EQ(qp::ChooseCone(0.5, qp::Cone::kOctagon).kind, ConeKind::kOctagon);
}

// Every edge lies on two neighbouring facets of the paper and inside the other six; every facet has two edges.
TEST(Cone, EdgesOfTheOctagonLieOnTheFacetsOfThePaper) {
  for (const double mu : {0.1, 0.7, 2.0}) {
    std::array<int, 8> edges_of_facet{};
    for (int k = 0; k < 8; ++k) {
      Rows z{};
      z[k] = 1;
      const Vector3 edge = qp::MapFromRows({ConeKind::kOctagon, mu}, z.data());
      EXPECT_DOUBLE_EQ(edge[0], 1);
      EXPECT_NEAR(edge.tail<2>().norm(), mu, 1e-15);  // on the circular cone
      for (int h = 0; h < 8; ++h) {
        const double side = Facet(h, mu).dot(edge);
        if (std::abs(side) < 1e-14) {
          ++edges_of_facet[h];
        } else {
          EXPECT_GT(side, 0.1 * mu);
        }
      }
    }
    for (int count : edges_of_facet) EXPECT_EQ(count, 2);
  }
}

TEST(Cone, OctagonLiesInTheCircleAndHoldsItsInnerCircle) {
  Random random(52);
  for (int trial = 0; trial < 500; ++trial) {
    const double mu = random.Uniform(0.05, 2), angle = random.Uniform(0, 7);
    Rows z{};
    for (double& value : z) value = random.Uniform(0, 1);
    const Vector3 j = qp::MapFromRows({ConeKind::kOctagon, mu}, z.data());
    EXPECT_LE(j.tail<2>().norm(), mu * j[0] * (1 + 1e-15));
    for (int h = 0; h < 8; ++h) EXPECT_GE(Facet(h, mu).dot(j), -1e-14);
    // mu_eff >= 0.924 mu, in every direction; the dual cone of the octagon holds that of the circle.
    const Vector3 inner(1, 0.9238 * mu * std::cos(angle), 0.9238 * mu * std::sin(angle));
    for (int h = 0; h < 8; ++h) EXPECT_GT(Facet(h, mu).dot(inner), 0);
    const Vector3 dual(mu, std::cos(angle), std::sin(angle));
    qp::MapToRows({ConeKind::kOctagon, mu}, dual, z.data());
    EXPECT_GE(qp::MinEigenvalue(ConeKind::kOctagon, z.data()), -1e-15);
    qp::MapToRows({ConeKind::kCircular, mu}, dual, z.data());
    EXPECT_NEAR(qp::MinEigenvalue(ConeKind::kCircular, z.data()), 0, 1e-15);
  }
}

}  // namespace
}  // namespace islet::testing
