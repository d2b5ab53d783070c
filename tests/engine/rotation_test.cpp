#include "engine/rotation.h"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace islet {
namespace {

constexpr double kPi = std::numbers::pi;

struct Top {
  Matrix3 inertia = Matrix3::Identity();
  Quaternion rotation = Quaternion::Identity();
  Vector3 angular_velocity = Vector3::Zero();

  void Step(double dt) {
    const Quaternion turned =
        Quaternion(Exp(FreeRotation(inertia, rotation, angular_velocity, dt)) * rotation).normalized();
    angular_velocity = AngularVelocityAfter(inertia, rotation, angular_velocity, turned);
    rotation = turned;
  }
  Vector3 VelocityB() const { return rotation.conjugate() * angular_velocity; }
  Vector3 MomentumW() const { return rotation * Vector3(inertia * VelocityB()); }
  double Energy() const { return 0.5 * VelocityB().dot(inertia * VelocityB()); }
};

TEST(Exp, QuarterTurnAboutZ) {
  const Quaternion q = Exp({0, 0, kPi / 2});
  EXPECT_NEAR(q.w(), std::sqrt(0.5), 1e-15);
  EXPECT_NEAR(q.z(), std::sqrt(0.5), 1e-15);
  EXPECT_NEAR((q * Vector3::UnitX() - Vector3::UnitY()).norm(), 0, 1e-15);
}

TEST(Exp, ZeroIsIdentityAndHalfTurnHasNoScalarPart) {
  EXPECT_EQ(Exp(Vector3::Zero()).coeffs(), Quaternion::Identity().coeffs());
  EXPECT_NEAR(Exp({kPi, 0, 0}).w(), 0, 1e-16);
}

// Both sides of the switch to the series must agree with each other and with unit length.
TEST(Exp, SmallAnglesKeepFullAccuracy) {
  for (const double angle : {1e-300, 1e-12, 1e-8, 0.999e-6, 1.001e-6, 1e-4}) {
    const Quaternion q = Exp({0, angle, 0});
    EXPECT_NEAR(q.y(), std::sin(angle / 2), 1e-16 * angle) << angle;
    EXPECT_NEAR(q.norm(), 1, 1e-15) << angle;
  }
}

TEST(Log, InvertsExpForRandomVectors) {
  std::mt19937 rng(1);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> exponent(-14, 0);
  for (int trial = 0; trial < 20000; ++trial) {
    const double angle = trial % 2 ? kPi * std::pow(10, exponent(rng)) : kPi * (1 - std::pow(10, exponent(rng)));
    const Vector3 v = angle * Vector3(gauss(rng), gauss(rng), gauss(rng)).normalized();
    EXPECT_LE((Log(Exp(v)) - v).norm(), 1e-14 + 4e-16 * angle) << angle;
  }
}

TEST(Log, SameForBothSignsOfTheQuaternion) {
  const Quaternion q = Exp({0.3, -1.2, 0.4});
  const Quaternion minus(-q.w(), -q.x(), -q.y(), -q.z());
  EXPECT_NEAR((Log(q) - Log(minus)).norm(), 0, 1e-15);
  EXPECT_LE(Log(minus).norm(), kPi);
}

TEST(FreeRotation, IsotropicBodyTurnsUniformly) {
  const Vector3 w(1, -20, 3);
  EXPECT_EQ(FreeRotation(2.5 * Matrix3::Identity(), Exp({1, 2, 3}), w, 0.1), Vector3(0.1 * w));
  EXPECT_EQ(AngularVelocityAfter(2.5 * Matrix3::Identity(), Exp({1, 2, 3}), w, Exp({0, 1, 0})), w);
}

TEST(FreeRotation, StandsStillWithoutVelocity) {
  EXPECT_EQ(FreeRotation(Vector3(1, 2, 3).asDiagonal(), Exp({1, 2, 3}), Vector3::Zero(), 0.1), Vector3::Zero());
}

// About a principal axis the Cayley map turns by 2 atan(w dt / 2), less than w dt by a twelfth of its cube; five of them of
// the shares p, p, 1 - 4 p, p, p, with 4 p^3 + (1 - 4 p)^3 = 0, lose only the fifth power.
// The squares of such velocities are zero.
TEST(FreeRotation, ATinyVelocityIsAVelocity) {
  const Matrix3 inertia = Vector3(1, 2, 3).asDiagonal();
  for (const double speed : {1e-100, 1e-160, 1e-170, 1e-300}) {
    const Vector3 velocity(speed, 0, speed / 2);
    EXPECT_LE((FreeRotation(inertia, Quaternion::Identity(), velocity, 0.1) / speed - 0.1 * velocity / speed).norm(),
              1e-15)
        << speed;
  }
}

TEST(FreeRotation, PrincipalAxisByHand) {
  const Matrix3 inertia = Vector3(1, 2, 2.5).asDiagonal();
  const double p = 1 / (4 - std::cbrt(4.0));
  for (const double dt : {2e-4, 0.1}) {
    const Vector3 turned = FreeRotation(inertia, Quaternion::Identity(), {0, 0, 4}, dt);
    const double sum = 8 * std::atan(2 * dt * p) + 2 * std::atan(2 * dt * (1 - 4 * p));
    EXPECT_NEAR((turned - Vector3(0, 0, sum)).norm(), 0, 1e-14 * dt) << dt;
    EXPECT_NEAR(turned.z(), 4 * dt, 1e-5) << dt;
  }
}

// Symmetric top: its axis circles the angular momentum at |L| / I_1, whichever axis that is, in a step as long as it likes.
TEST(FreeRotation, SymmetricTopIsExactInOneStep) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double unlike : {0.02, 1.7}) {
      Vector3 inertia = Vector3::Ones();
      inertia[axis] = unlike;
      Top top{.inertia = inertia.asDiagonal(), .rotation = Exp({0.4, 0.1, 0.2}), .angular_velocity = {1, 0.5, 2}};
      const Vector3 momentum = top.MomentumW(), axis_before = top.rotation * Vector3::Unit(axis);
      const double energy = top.Energy(), spin = top.VelocityB()[axis];
      top.Step(7.0);
      EXPECT_NEAR((top.rotation * Vector3::Unit(axis) - Exp(7.0 * momentum) * axis_before).norm(), 0, 1e-14);
      EXPECT_NEAR((top.MomentumW() - momentum).norm(), 0, 1e-14);
      EXPECT_NEAR(top.Energy(), energy, 1e-14);
      EXPECT_NEAR(top.VelocityB()[axis], spin, 1e-13);
    }
  }
}

// All but symmetric: the angle is fourth order in dt.
TEST(FreeRotation, TopPrecessesAtItsRateToFourthOrder) {
  double errors[2];
  for (int fine = 0; fine < 2; ++fine) {
    Top top{.inertia = Vector3(1, 1 + 1e-12, 1.7).asDiagonal(),
            .rotation = Exp({0.4, 0.1, 0.2}),
            .angular_velocity = {1, 0.5, 2}};
    const Vector3 momentum = top.MomentumW();
    const Vector3 axis_before = top.rotation * Vector3::UnitZ();
    const int steps = fine ? 80 : 40;
    for (int i = 0; i < steps; ++i) top.Step(2.0 / steps);
    const Vector3 expected = Exp(2.0 * momentum) * axis_before;  // I_1 = 1
    errors[fine] = (top.rotation * Vector3::UnitZ() - expected).norm();
  }
  EXPECT_NEAR(errors[0] / errors[1], 16, 0.3);
  EXPECT_LT(errors[0], 1e-5);
}

// T33: turning about the middle axis is unstable; the top flips over and back, with |L| and E kept.
TEST(FreeRotation, AsymmetricTopKeepsMomentumAndEnergyOverAThousandTurnsAndFlips) {
  Top top{.inertia = Vector3(1, 2, 2.8).asDiagonal(), .rotation = Exp({0.3, -0.7, 1.1}), .angular_velocity = {}};
  top.angular_velocity = top.rotation * Vector3(1e-3, 2 * kPi, 1e-3);  // one turn a second
  const Vector3 momentum = top.MomentumW();
  const double energy = top.Energy();
  int flips = 0;
  double worst_momentum = 0, worst_energy = 0;
  bool forward = true;
  for (int i = 0; i < 60 * 1000; ++i) {
    top.Step(1.0 / 60);
    worst_momentum = std::max(worst_momentum, (top.MomentumW() - momentum).norm() / momentum.norm());
    worst_energy = std::max(worst_energy, std::abs(top.Energy() - energy) / energy);
    if ((top.VelocityB().y() > 0) != forward) forward = !forward, ++flips;
  }
  EXPECT_LT(worst_momentum, 1e-9);
  EXPECT_LT(worst_energy, 1e-9);
  EXPECT_GT(flips, 100);
}

// Flips are half a period of the Jacobi elliptic functions apart, 2 K(k) / lambda.                        [LL76 Sec. 37]
TEST(FreeRotation, FlipPeriodMatchesTheEllipticIntegral) {
  const Vector3 moments(1, 2, 2.8), w(0.1, 3, 0.05);
  const double energy_2 = moments.dot(w.cwiseAbs2()), momentum_2 = moments.cwiseAbs2().dot(w.cwiseAbs2());
  double a = moments[0], b = moments[1], c = moments[2];
  if (momentum_2 < energy_2 * b) std::swap(a, c);
  const double lambda = std::sqrt((c - b) * (momentum_2 - energy_2 * a) / (a * b * c));
  const double k = std::sqrt((b - a) * (energy_2 * c - momentum_2) / ((c - b) * (momentum_2 - energy_2 * a)));
  const double expected = 2 * std::comp_ellint_1(k) / lambda;

  Top top{.inertia = moments.asDiagonal(), .angular_velocity = w};
  const double dt = 2e-3;
  std::vector<double> crossings;
  for (int i = 0; crossings.size() < 4; ++i) {
    ASSERT_LT(i, 100000);
    const double before = top.VelocityB().y();
    top.Step(dt);
    const double after = top.VelocityB().y();
    if ((before > 0) != (after > 0)) crossings.push_back(dt * (i + before / (before - after)));
  }
  for (size_t i = 1; i < crossings.size(); ++i) EXPECT_NEAR(crossings[i] - crossings[i - 1], expected, 1e-6 * expected);
}

// Also with steps far beyond accuracy: 1.6 turns a step, needle-like inertia.
TEST(FreeRotation, RandomTopsKeepMomentumAndEnergyAtAnyStep) {
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> uniform(-1, 1), share(0.001, 1);
  for (int trial = 0; trial < 300; ++trial) {
    const Vector3 squares(share(rng), share(rng), share(rng));  // second moments: any three make an inertia
    const Matrix3 axes = Exp({uniform(rng), uniform(rng), uniform(rng)}).toRotationMatrix();
    const Vector3 moments = squares.sum() * Vector3::Ones() - squares;
    Top top{.inertia = axes * moments.asDiagonal() * axes.transpose(), .rotation = Exp({3 * uniform(rng), 0, 1})};
    top.angular_velocity = 10 * Vector3(uniform(rng), uniform(rng), uniform(rng));
    const Vector3 momentum = top.MomentumW();
    const double energy = top.Energy();
    const double dt = trial % 3 == 0 ? 1.0 : 1.0 / 30;
    for (int i = 0; i < 200; ++i) top.Step(dt);
    EXPECT_LT((top.MomentumW() - momentum).norm(), 1e-11 * momentum.norm()) << trial;
    EXPECT_NEAR(top.Energy(), energy, 1e-10 * energy) << trial;
  }
}

}  // namespace
}  // namespace islet
