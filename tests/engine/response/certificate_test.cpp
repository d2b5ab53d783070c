#include "engine/response/certificate.h"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "qp/cascade/island_solver.h"

namespace islet {
namespace {

using qp::Cone;
using qp::Model;

// A point mass of 2 kg on a plane, contact frame = world axes (n, t1, t2) = (x, y, z), mu = 0.5.
qp::Problem PointMass(const Vector3& velocity, double friction = 0.5) {
  qp::Problem problem;
  qp::BodyTerm body;
  body.mass = 2;
  body.velocity << velocity, Vector3::Zero();
  problem.bodies.push_back(body);
  qp::ContactTerm contact;
  contact.body_b = 0;
  contact.jacobian_b.leftCols<3>().setIdentity();
  contact.friction = friction;
  problem.contacts.push_back(contact);
  return problem;
}

// Falls at 1 m/s and slides at 3: exact Coulomb gives j = (2, -1, 0), v = (0, 2.5, 0), slip term 1.25.
qp::Solution SlidingAnswer() {
  qp::Solution s;
  s.velocities = {0, 2.5, 0, 0, 0, 0};
  s.impulses = {{2, -1, 0}};
  s.slips = {1.25};
  return s;
}
constexpr double kVRef = 1.0;

Certificate CertifySliding(const qp::Solution& s, Cone cone = Cone::kCircular) {
  return Certify(PointMass({-1, 3, 0}), s, Model::kCoulomb, cone, kVRef);
}

TEST(Certify, RightAnswerHasNoResidual) {
  const Certificate c = CertifySliding(SlidingAnswer());
  for (const double residual : {c.momentum, c.cone, c.dual, c.gap, c.natural_map_max, c.natural_map_rms,
                                c.coulomb_map_max, c.coulomb_map_rms, c.energy_gain})
    EXPECT_NEAR(residual, 0, 1e-15);
}

TEST(Certify, NoContactsNothingToCertify) {
  qp::Problem problem = PointMass({1, 2, 3});
  problem.contacts.clear();
  EXPECT_EQ(Certify(problem, {}, Model::kCoulomb, Cone::kCircular, 1).momentum, 0);
}

// sqrt(m d^2 / m) / v_ref: the residual is the missing velocity itself.
TEST(Certify, MomentumIsTheMissingVelocityInTheMassMetric) {
  for (const double missing : {1e-9, 1e-3, 0.5}) {
    qp::Solution s = SlidingAnswer();
    s.velocities[2] += missing;
    EXPECT_NEAR(CertifySliding(s).momentum, missing, 1e-12);
    s = SlidingAnswer();
    s.velocities[4] += missing;  // unit inertia, 2 kg: sqrt(d^2 / 2)
    EXPECT_NEAR(CertifySliding(s).momentum, missing / std::sqrt(2.0), 1e-12);
  }
}

// j_t = mu j_n + d lies d cos(atan mu) outside the cone.
TEST(Certify, ConeIsTheDistanceFromTheCone) {
  for (const double outside : {1e-6, 0.1}) {
    qp::Solution s = SlidingAnswer();
    s.impulses[0].y() -= outside;
    EXPECT_NEAR(CertifySliding(s).cone, outside / std::sqrt(1.25) / 2, 1e-12);
    s.impulses[0] = {-outside, 0, 0};  // pulls: the nearest point is the tip
    EXPECT_NEAR(CertifySliding(s).cone, outside / 2, 1e-12);
  }
}

TEST(Certify, DualIsTheApproachThatIsLeft) {
  for (const double approach : {1e-6, 0.1}) {
    qp::Solution s = SlidingAnswer();
    s.velocities[0] = -approach;
    EXPECT_NEAR(CertifySliding(s).dual, approach, 1e-12);
    s = SlidingAnswer();
    s.slips[0] -= approach;  // K*: u_n + s >= mu |u_t|
    EXPECT_NEAR(CertifySliding(s).dual, approach, 1e-12);
  }
}

// j . (u + s n) over E_0 + m v_ref^2 / 2; E_0 = 10 J.
TEST(Certify, GapIsTheWorkThatShouldBeZero) {
  qp::Solution s = SlidingAnswer();
  s.velocities[0] = 0.1;
  EXPECT_NEAR(CertifySliding(s).gap, 2 * 0.1 / 11, 1e-14);
  EXPECT_NEAR(Certify(PointMass({-1, 3, 0}), s, Model::kCoulomb, Cone::kCircular, 3).gap, 2 * 0.1 / 19, 1e-14);
}

// An impulse too small by d leaves the map at least of that order, in velocity: d / m.
TEST(Certify, MapsGrowWithTheErrorOfTheImpulse) {
  double last = 0;
  for (const double missing : {1e-8, 1e-5, 1e-2, 1.0}) {
    qp::Solution s = SlidingAnswer();
    s.impulses[0] *= 1 - missing / 2;
    s.velocities = {-missing / 2, 2.5 + missing / 4, 0, 0, 0, 0};
    s.slips[0] = 0.5 * s.velocities[1];
    const Certificate c = CertifySliding(s);
    EXPECT_LT(c.momentum, 1e-12);
    EXPECT_GT(c.natural_map_max, 0.1 * missing);
    EXPECT_LT(c.natural_map_max, 2 * missing);
    EXPECT_GT(c.natural_map_max, last);
    EXPECT_NEAR(c.natural_map_max, c.natural_map_rms, 1e-15);  // one contact
    EXPECT_NEAR(c.natural_map_max, c.coulomb_map_max, 1e-12);
    last = c.natural_map_max;
  }
}

// The convex optimum is a right answer to its own problem, and the certificate says how wrong it is for Coulomb.
TEST(Certify, ConvexAnswerIsExactForItselfAndFarFromCoulomb) {
  const qp::Problem problem = PointMass({-1, 3, 0});
  qp::Solution s;  // nearest point of K*: |u_t| = (3 - 0.5) / 1.25 = 2, u_n = 1
  s.velocities = {1, 2, 0, 0, 0, 0};
  s.impulses = {{4, -2, 0}};
  s.slips = {0};
  const Certificate c = Certify(problem, s, Model::kConvex, Cone::kCircular, 1);
  EXPECT_NEAR(c.natural_map_max, 0, 1e-15);
  EXPECT_NEAR(c.momentum, 0, 1e-15);
  EXPECT_NEAR(c.gap, 0, 1e-15);
  EXPECT_GT(c.coulomb_map_max, 0.5);
}

TEST(Certify, EnergyGainInJoules) {
  qp::Solution s = SlidingAnswer();
  s.velocities = {2, 3, 0, 0, 0, 0};
  EXPECT_NEAR(CertifySliding(s).energy_gain, 3, 1e-14);  // 13 J against 10 J
}

// Rms over contacts, maximum of the worst; a second contact that is right halves the mean square.
TEST(Certify, RmsAndMaximumOverContacts) {
  qp::Problem problem = PointMass({-1, 3, 0});
  problem.bodies.push_back(PointMass({1, 0, 0}).bodies[0]);
  problem.contacts.push_back(problem.contacts[0]);
  problem.contacts[1].body_b = 1;
  qp::Solution s = SlidingAnswer();
  s.velocities = {-0.1, 2.5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0};
  s.impulses.push_back(Vector3::Zero());
  s.slips.push_back(0);
  const Certificate c = Certify(problem, s, Model::kCoulomb, Cone::kCircular, 1);
  EXPECT_GT(c.natural_map_max, 0.05);
  EXPECT_NEAR(c.natural_map_rms, c.natural_map_max / std::sqrt(2.0), 1e-14);
}

TEST(Certify, BounceTargetsAreJudged) {
  qp::Problem problem = PointMass({-2, 0, 0});
  problem.contacts[0].target = 1;
  qp::Solution s;
  s.velocities = {1, 0, 0, 0, 0, 0};
  s.impulses = {{6, 0, 0}};
  s.slips = {0};
  EXPECT_NEAR(Certify(problem, s, Model::kCoulomb, Cone::kCircular, 2).coulomb_map_max, 0, 1e-15);
  s.velocities[0] = 0.5, s.impulses[0][0] = 5;  // bounced too little
  const Certificate c = Certify(problem, s, Model::kCoulomb, Cone::kCircular, 2);
  EXPECT_NEAR(c.dual, 0.25, 1e-14);
  EXPECT_NEAR(c.coulomb_map_max, 0.5, 1e-14);  // frictionless direction: the map is the missing speed
}

// Drift and compliance belong to the contact velocity.
TEST(Certify, DriftCounts) {
  qp::Problem problem = PointMass({0, 0, 0});
  problem.contacts[0].drift = {-1, 0, 0};  // a wall that comes at 1 m/s
  qp::Solution s;
  s.velocities = {1, 0, 0, 0, 0, 0};
  s.impulses = {{2, 0, 0}};
  s.slips = {0};
  EXPECT_NEAR(Certify(problem, s, Model::kCoulomb, Cone::kCircular, 1).natural_map_max, 0, 1e-15);
  problem.contacts[0].drift[0] = -1.5;
  EXPECT_NEAR(Certify(problem, s, Model::kCoulomb, Cone::kCircular, 1).dual, 0.5, 1e-14);
}

// Projection on an intersection of half-spaces by Dykstra's alternation: nothing in common with faces and edges.
Vector3 DykstraOctagon(const Vector3& x, double mu) {
  const double slope = mu * std::cos(std::numbers::pi / 8);
  Vector3 facets[8], corrections[8];
  for (int h = 0; h < 8; ++h) {
    facets[h] = Vector3(slope, std::cos(h * std::numbers::pi / 4), std::sin(h * std::numbers::pi / 4)).normalized();
    corrections[h].setZero();
  }
  Vector3 p = x;
  for (int sweep = 0; sweep < 3000; ++sweep) {
    for (int h = 0; h < 8; ++h) {
      const Vector3 y = p + corrections[h];
      p = y - std::min(0.0, facets[h].dot(y)) * facets[h];
      corrections[h] = y - p;
    }
  }
  return p;
}

TEST(Certify, OctagonDistanceAgreesWithDykstra) {
  std::mt19937 rng(1);
  std::normal_distribution<double> gauss;
  int inside = 0, outside = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const double mu = trial % 3 == 0 ? 0.1 : trial % 3 == 1 ? 0.6 : 2.0;
    qp::Solution s = SlidingAnswer();
    s.impulses[0] = Vector3(gauss(rng), gauss(rng), gauss(rng));
    const double distance = Certify(PointMass({-1, 3, 0}, mu), s, Model::kConvex, Cone::kOctagon, 1).cone * 2;
    EXPECT_NEAR(distance, (s.impulses[0] - DykstraOctagon(s.impulses[0], mu)).norm(), 1e-5)
        << trial << " " << s.impulses[0].transpose();
    (distance == 0 ? inside : outside) += 1;
  }
  EXPECT_GT(inside, 10);
  EXPECT_GT(outside, 100);
}

// The cone's edges point at odd multiples of 22.5 degrees and reach mu; its facets only mu cos 22.5.
TEST(Certify, OctagonByHand) {
  qp::Solution s = SlidingAnswer();
  const double edge = std::numbers::pi / 8;
  s.impulses = {{1, 0.5 * std::cos(edge), 0.5 * std::sin(edge)}};
  EXPECT_NEAR(CertifySliding(s, Cone::kOctagon).cone, 0, 1e-14);
  const double reach = 0.5 * std::cos(edge);
  s.impulses = {{1, reach, 0}};
  EXPECT_NEAR(CertifySliding(s, Cone::kOctagon).cone, 0, 1e-14);
  s.impulses = {{1, 0.5, 0}};
  EXPECT_NEAR(CertifySliding(s, Cone::kOctagon).cone, (0.5 - reach) / std::sqrt(1 + reach * reach) / 2, 1e-14);
  // Dual: w_n >= mu |w_t| in the direction of an edge.
  s.slips = {0};
  s.velocities = {0, -std::cos(edge), -std::sin(edge), 0, 0, 0};
  EXPECT_NEAR(Certify(PointMass({0, 0, 0}), s, Model::kConvex, Cone::kOctagon, 1).dual, 0.5, 1e-14);
}

TEST(Certify, FrictionlessConeIsARay) {
  qp::Solution s;
  s.velocities = {0, 3, 0, 0, 0, 0};
  s.impulses = {{2, 0, 0}};
  s.slips = {0};
  for (const Cone cone : {Cone::kCircular, Cone::kOctagon}) {
    EXPECT_NEAR(Certify(PointMass({-1, 3, 0}, 0), s, Model::kCoulomb, cone, 1).natural_map_max, 0, 1e-15);
    qp::Solution rubbed = s;
    rubbed.impulses[0].y() = 0.3;
    EXPECT_NEAR(Certify(PointMass({-1, 3, 0}, 0), rubbed, Model::kCoulomb, cone, 1).cone, 0.15, 1e-15);
  }
}

// Answers of the solver pass; the same answers disturbed at random do not.
TEST(Certify, EveryRandomDisturbanceOfASolvedIslandShows) {
  std::mt19937 rng(5);
  std::normal_distribution<double> gauss;
  qp::Problem problem;
  for (int i = 0; i < 3; ++i) {
    qp::BodyTerm body;
    body.velocity << Vector3(gauss(rng), gauss(rng), gauss(rng)), Vector3(gauss(rng), gauss(rng), gauss(rng));
    problem.bodies.push_back(body);
  }
  for (int c = 0; c < 6; ++c) {
    qp::ContactTerm contact;
    contact.body_a = c % 3 - 1;
    contact.body_b = contact.body_a + 1;
    contact.friction = 0.4;
    const Vector3 r(gauss(rng), gauss(rng), gauss(rng));
    Matrix3 cross;
    cross << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
    contact.jacobian_b << Matrix3::Identity(), -cross;
    if (contact.body_a >= 0) contact.jacobian_a << -Matrix3::Identity(), 0.5 * cross;
    problem.contacts.push_back(contact);
  }
  qp::Settings settings;
  settings.model = Model::kConvex;
  settings.tolerance = 1e-12;
  qp::Solution solution;
  qp::IslandSolver().Solve(problem, settings, &solution);
  const Certificate good = Certify(problem, solution, Model::kConvex, Cone::kCircular, 1);
  EXPECT_LT(good.natural_map_max, 1e-5);
  EXPECT_LT(good.momentum, 1e-9);
  for (int trial = 0; trial < 200; ++trial) {
    qp::Solution bad = solution;
    if (trial % 2) {
      bad.velocities[trial % 18] += 0.01;
    } else {
      bad.impulses[trial % 6][trial / 2 % 3] += 0.01;
    }
    EXPECT_GT(Certify(problem, bad, Model::kConvex, Cone::kCircular, 1).momentum, 1e-3) << trial;
  }
}

// What is no number stays to be seen.
TEST(Certify, NoNumberIsNoExactness) {
  qp::Solution s = SlidingAnswer();
  s.velocities[0] = NAN;
  const Certificate bad = CertifySliding(s);
  Certificate all = CertifySliding(SlidingAnswer());
  all.Include(bad);
  all.Include(CertifySliding(SlidingAnswer()));
  for (const double residual : {all.natural_map_max, all.natural_map_rms, all.coulomb_map_max, all.coulomb_map_rms})
    EXPECT_TRUE(std::isnan(residual));
}

}  // namespace
}  // namespace islet
