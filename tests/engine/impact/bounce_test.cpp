#include "engine/impact/bounce.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace islet {
namespace {

Contact MakeContact(const Vector3& point, double friction, double restitution) {
  return {.body_a = 0,
          .body_b = 1,
          .point_W = point,
          .normal_W = Vector3::UnitZ(),
          .friction = friction,
          .restitution = restitution};
}
const Matrix3 kFrame = ContactFrame(Vector3::UnitZ());  // (z, x, y)

void Bounce(const Contact& contact, BounceLaw law, BounceBody* a, BounceBody* b) {
  const Matrix3 frame = ContactFrame(contact.normal_W);
  const Vector3 impulse = frame * BounceImpulse(*a, *b, contact, frame, law);
  a->ApplyImpulse(-impulse, contact.point_W);
  b->ApplyImpulse(impulse, contact.point_W);
}

double Energy(const BounceBody& body) {
  if (body.inverse_mass == 0) return 0;
  return 0.5 * body.linear_velocity_W.squaredNorm() / body.inverse_mass +
         0.5 * body.angular_velocity_W.dot(body.inverse_inertia_W.inverse() * body.angular_velocity_W);
}

// Unit mass and inertia, contact at lever (1, 0, -1) from the centre, falling and drifting at 1 m/s onto a wall:
// u = (-1, 1, 0), W_nn = W_tt = 2, W_nt = 1.
BounceBody LeverBody() {
  return {.inverse_mass = 1,
          .inverse_inertia_W = Matrix3::Identity(),
          .position_W = {-1, 0, 1},
          .linear_velocity_W = {1, 0, -1}};
}

constexpr BounceLaw kAllLaws[] = {BounceLaw::kEq5, BounceLaw::kEq6, BounceLaw::kExact};

// Eq. 2: j = (1 + e) v / (1/m_a + 1/m_b) = 1.5 * 2 / (1 + 1/3).
TEST(BounceImpulse, HeadOnSpheresByHand) {
  for (const BounceLaw law : kAllLaws) {
    BounceBody a{.inverse_mass = 1, .inverse_inertia_W = 2 * Matrix3::Identity()};
    BounceBody b{.inverse_mass = 1.0 / 3,
                 .inverse_inertia_W = Matrix3::Identity(),
                 .position_W = {0, 0, 1},
                 .linear_velocity_W = {0, 0, -2}};
    const Contact contact = MakeContact({0, 0, 0.5}, 0.7, 0.5);
    EXPECT_NEAR((BounceImpulse(a, b, contact, kFrame, law) - Vector3(2.25, 0, 0)).norm(), 0, 1e-14);
    Bounce(contact, law, &a, &b);
    EXPECT_NEAR(a.linear_velocity_W.z(), -2.25, 1e-14);
    EXPECT_NEAR(b.linear_velocity_W.z(), -2 + 0.75, 1e-14);
  }
}

TEST(BounceImpulse, ZeroWhereBodiesSeparateOrRest) {
  for (const BounceLaw law : kAllLaws) {
    const BounceBody wall;
    for (const double speed : {0.0, 1e-300, 3.0}) {
      const BounceBody b{.inverse_mass = 1,
                         .inverse_inertia_W = Matrix3::Identity(),
                         .position_W = {0, 0, 1},
                         .linear_velocity_W = {5, 0, speed}};
      EXPECT_EQ(BounceImpulse(wall, b, MakeContact(Vector3::Zero(), 0.5, 1), kFrame, law), Vector3::Zero());
    }
  }
}

TEST(BounceImpulse, Equation5TakesTheNormalImpulseWithoutFriction) {
  const Vector3 j = BounceImpulse({}, LeverBody(), MakeContact(Vector3::Zero(), 0.5, 0.5), kFrame, BounceLaw::kEq5);
  EXPECT_NEAR((j - 0.75 * Vector3(1, -0.5, 0)).norm(), 0, 1e-15);  // 1.5 * 1 / W_nn
}

TEST(BounceImpulse, Equation6BouncesExactlyWithFriction) {
  BounceBody wall, body = LeverBody();
  const Contact contact = MakeContact(Vector3::Zero(), 0.5, 0.5);
  const Vector3 j = BounceImpulse(wall, body, contact, kFrame, BounceLaw::kEq6);
  EXPECT_NEAR((j - Vector3(1, -0.5, 0)).norm(), 0, 1e-15);  // 1.5 / (W_nn - 0.5 W_nt)
  Bounce(contact, BounceLaw::kEq6, &wall, &body);
  EXPECT_NEAR(body.VelocityAt(contact.point_W).z(), 0.5, 1e-15);
}

// Without slip Eqs. 5 and 6 have no friction direction: purely normal.
TEST(BounceImpulse, NoSlipNoFriction) {
  BounceBody body = LeverBody();
  body.linear_velocity_W = {0, 0, -1};
  for (const BounceLaw law : {BounceLaw::kEq5, BounceLaw::kEq6})
    EXPECT_NEAR(
        (BounceImpulse({}, body, MakeContact(Vector3::Zero(), 0.5, 0), kFrame, law) - Vector3(0.5, 0, 0)).norm(), 0,
        1e-15);
}

// [2 1; 1 2] j = (1, -1): sticking needs j = (1, -1), allowed from mu = 1 on.
TEST(BounceImpulse, ExactLawSticksIfTheConeHoldsTheStickingImpulse) {
  BounceBody wall, body = LeverBody();
  const Contact contact = MakeContact(Vector3::Zero(), 1.5, 0);
  EXPECT_NEAR((BounceImpulse(wall, body, contact, kFrame, BounceLaw::kExact) - Vector3(1, -1, 0)).norm(), 0, 1e-14);
  Bounce(contact, BounceLaw::kExact, &wall, &body);
  EXPECT_NEAR(body.VelocityAt(contact.point_W).norm(), 0, 1e-14);
}

// 2 j - 0.5 j = 1: j = (2/3, -1/3), and the slip goes on: u_t = 1 + 2/3 - 2/3.
TEST(BounceImpulse, ExactLawSlidesOnTheConeOtherwise) {
  BounceBody wall, body = LeverBody();
  const Contact contact = MakeContact(Vector3::Zero(), 0.5, 0);
  EXPECT_NEAR((BounceImpulse(wall, body, contact, kFrame, BounceLaw::kExact) - Vector3(2, -1, 0) / 3).norm(), 0, 1e-12);
  Bounce(contact, BounceLaw::kExact, &wall, &body);
  EXPECT_NEAR((body.VelocityAt(contact.point_W) - Vector3(1, 0, 0)).norm(), 0, 1e-12);
}

// T6. A ball of radius r with spin w meets a floor obliquely; W_tt = 7 / (2 m), W_nn = 1 / m, W_nt = 0.
//   grips   if |u_t| <= 7/2 mu (1 + e) |v_n|: contact point at rest, v_x = (5 v_x + 2 r w) / 7
//   slides  else: v_x changes by mu (1 + e) |v_n|
TEST(BounceImpulse, ObliqueBounceOfASphere) {
  for (const double restitution : {0.0, 0.5, 1.0}) {
    for (const double friction : {0.0, 0.1, 0.3, 2.0}) {
      for (const double vx : {-4.0, 0.0, 3.0}) {
        for (const double spin : {-10.0, 0.0, 7.0}) {
          const double r = 0.3, mass = 2, vz = -2;
          BounceBody wall;
          BounceBody ball{.inverse_mass = 1 / mass,
                          .inverse_inertia_W = Matrix3::Identity() / (0.4 * mass * r * r),
                          .position_W = {0, 0, r},
                          .linear_velocity_W = {vx, 0, vz},
                          .angular_velocity_W = {0, spin, 0}};
          const double slip = vx - r * spin, reach = friction * (1 + restitution) * -vz;
          const bool grips = std::abs(slip) <= 3.5 * reach;
          Bounce(MakeContact(Vector3::Zero(), friction, restitution), BounceLaw::kExact, &wall, &ball);
          const double sign = slip > 0 ? 1 : -1;
          EXPECT_NEAR(ball.linear_velocity_W.z(), restitution * -vz, 1e-13);
          EXPECT_NEAR(ball.linear_velocity_W.x(), grips ? (5 * vx + 2 * r * spin) / 7 : vx - sign * reach, 1e-13);
          const double spin_after = grips ? (5 * vx + 2 * r * spin) / 7 / r : spin + sign * 2.5 * reach / r;
          EXPECT_NEAR(ball.angular_velocity_W.y(), spin_after, 1e-12);
        }
      }
    }
  }
}

BounceBody RandomBody(std::mt19937& rng) {
  std::uniform_real_distribution<double> uniform(-1, 1), share(0.05, 1);
  const Vector3 squares(share(rng), share(rng), share(rng));
  const Matrix3 axes =
      Quaternion(uniform(rng), uniform(rng), uniform(rng), uniform(rng)).normalized().toRotationMatrix();
  const Vector3 moments = squares.sum() * Vector3::Ones() - squares;
  BounceBody body{.inverse_mass = share(rng)};
  body.inverse_inertia_W = axes * moments.cwiseInverse().asDiagonal() * axes.transpose();
  body.position_W = Vector3(uniform(rng), uniform(rng), uniform(rng));
  body.linear_velocity_W = 5 * Vector3(uniform(rng), uniform(rng), uniform(rng));
  body.angular_velocity_W = 5 * Vector3(uniform(rng), uniform(rng), uniform(rng));
  return body;
}

// Rounding must not be taken for a gain of energy, which would lower the restitution.
TEST(BounceImpulse, ElasticSmoothBounceKeepsEnergyAndTurnsTheSpeedRound) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int trial = 0; trial < 10000; ++trial) {
    BounceBody a = RandomBody(rng), b = RandomBody(rng);
    const Contact contact = MakeContact({uniform(rng), uniform(rng), uniform(rng)}, 0, 1);
    const double speed = (b.VelocityAt(contact.point_W) - a.VelocityAt(contact.point_W)).z();
    if (speed >= 0) continue;
    const double before = Energy(a) + Energy(b);
    Bounce(contact, BounceLaw::kExact, &a, &b);
    EXPECT_NEAR((b.VelocityAt(contact.point_W) - a.VelocityAt(contact.point_W)).z(), -speed, 1e-12);
    EXPECT_NEAR(Energy(a) + Energy(b), before, 1e-12 * before);
  }
}

// Kane's paradox included: levers that couple slip and normal motion, friction up to 100, restitution up to 1.
TEST(BounceImpulse, ExactLawNeverRaisesEnergyAndEndsApproach) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> uniform(0, 1), signed_uniform(-1, 1);
  int bounced = 0;
  for (int trial = 0; trial < 50000; ++trial) {
    BounceBody a = trial % 3 == 0 ? BounceBody{} : RandomBody(rng), b = RandomBody(rng);
    Contact contact = MakeContact({signed_uniform(rng), signed_uniform(rng), signed_uniform(rng)},
                                  trial % 5 == 0 ? 100 * uniform(rng) : uniform(rng), trial % 2 ? 1 : uniform(rng));
    contact.normal_W = Vector3(signed_uniform(rng), signed_uniform(rng), signed_uniform(rng)).normalized();
    const Matrix3 frame = ContactFrame(contact.normal_W);
    const Vector3 j = BounceImpulse(a, b, contact, frame, BounceLaw::kExact);
    if (j.isZero(0)) continue;
    ++bounced;
    const double before = Energy(a) + Energy(b);
    const Vector3 momentum_b = b.linear_velocity_W / b.inverse_mass;
    Bounce(contact, BounceLaw::kExact, &a, &b);
    EXPECT_LE(Energy(a) + Energy(b), before * (1 + 1e-12)) << trial;
    EXPECT_LE(j.tail<2>().norm(), contact.friction * j[0] * (1 + 1e-9)) << trial;
    EXPECT_GE(contact.normal_W.dot(b.VelocityAt(contact.point_W) - a.VelocityAt(contact.point_W)), -1e-10) << trial;
    EXPECT_NEAR((b.linear_velocity_W / b.inverse_mass - momentum_b - frame * j).norm(), 0, 1e-9) << trial;
  }
  EXPECT_GT(bounced, 20000);
}

// All laws keep |j_t| <= mu j_n and push, never pull.
TEST(BounceImpulse, EveryLawStaysInTheCone) {
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int trial = 0; trial < 10000; ++trial) {
    const BounceBody a = RandomBody(rng), b = RandomBody(rng);
    const Contact contact =
        MakeContact({uniform(rng), uniform(rng), uniform(rng)}, std::abs(2 * uniform(rng)), std::abs(uniform(rng)));
    for (const BounceLaw law : kAllLaws) {
      const Vector3 j = BounceImpulse(a, b, contact, kFrame, law);
      EXPECT_TRUE(j.allFinite());
      EXPECT_LE(j.tail<2>().norm(), contact.friction * j[0] * (1 + 1e-9)) << trial;
    }
  }
}

}  // namespace
}  // namespace islet
