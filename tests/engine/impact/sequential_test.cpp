#include "engine/impact/sequential.h"

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/no_alloc.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

// Bodies and contacts of one group, as the suite would hand them over.
struct Group {
  std::vector<Body> bodies;
  std::vector<Contact> contacts;
  std::vector<Matrix3> frames;
  std::vector<Vector3> impulses;
  std::vector<int> body_numbers, contact_numbers;
  Settings settings;
  SequentialResolver resolver;

  void Finish() {
    frames.clear(), body_numbers.clear();
    for (const Contact& c : contacts) frames.push_back(ContactFrame(c.normal_W));
    impulses.assign(contacts.size(), Vector3::Zero());
    for (size_t i = 0; i < bodies.size(); ++i)
      if (bodies[i].kind == BodyKind::kDynamic) body_numbers.push_back(static_cast<int>(i));
    contact_numbers.resize(contacts.size());
    std::iota(contact_numbers.begin(), contact_numbers.end(), 0);
  }
  int Resolve(double threshold = 1e-12) { return Resolve({threshold, settings.bounce_limit}); }
  int Resolve(const BounceRule& rule) {
    return resolver.Resolve(body_numbers, contact_numbers, {contacts, frames}, settings.bounce_law, rule, bodies,
                            impulses);
  }
  double FastestApproach() const {
    double fastest = 0;
    for (const Contact& c : contacts)
      fastest = std::max(fastest, -NormalVelocity(c, bodies[c.body_a], bodies[c.body_b]));
    return fastest;
  }
  double KineticEnergy() const {
    double sum = 0;
    for (const Body& b : bodies) sum += b.kind == BodyKind::kDynamic ? b.KineticEnergy() : 0;
    return sum;
  }
};

// n touching balls in a row along x, the first k of which move at 1 m/s.                              [SM04 Fig. 3]
Group OfficeToy(int n, int k) {
  Group g;
  for (int i = 0; i < n; ++i) {
    Body ball;
    ball.inertia_B = 0.1 * Matrix3::Identity();
    ball.position_W.x() = i;
    if (i < k) ball.linear_velocity_W.x() = 1;
    g.bodies.push_back(ball);
    if (i > 0)
      g.contacts.push_back(
          {.body_a = i - 1, .body_b = i, .point_W = {i - 0.5, 0, 0}, .normal_W = Vector3::UnitX(), .restitution = 1});
  }
  g.Finish();
  return g;
}

// A heap of spheres at random places, every near pair in contact; `walls` of them fixed.
Group RandomGroup(unsigned seed, int n, int walls, double friction, double restitution) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Group g;
  for (int i = 0; i < n; ++i) {
    Body body;
    body.kind = i < walls ? BodyKind::kFixed : BodyKind::kDynamic;
    body.mass = 1.5 + uniform(rng);
    body.inertia_B = Vector3(1, 1.2, 1.5).asDiagonal() * (0.1 * body.mass);
    body.position_W = 2 * Vector3(uniform(rng), uniform(rng), uniform(rng));
    if (i >= walls) {
      body.linear_velocity_W = 3 * Vector3(uniform(rng), uniform(rng), uniform(rng));
      body.angular_velocity_W = 3 * Vector3(uniform(rng), uniform(rng), uniform(rng));
    }
    g.bodies.push_back(body);
  }
  for (int a = 0; a < n; ++a) {
    for (int b = std::max(a + 1, walls); b < n; ++b) {
      const Vector3 apart = g.bodies[b].position_W - g.bodies[a].position_W;
      if (apart.norm() > 2) continue;
      const Vector3 offset = 0.2 * Vector3(uniform(rng), uniform(rng), uniform(rng));
      g.contacts.push_back({.body_a = a,
                            .body_b = b,
                            .point_W = 0.5 * (g.bodies[a].position_W + g.bodies[b].position_W) + offset,
                            .normal_W = apart.normalized(),
                            .friction = friction,
                            .restitution = restitution});
    }
  }
  g.Finish();
  return g;
}

TEST(BounceLimit, BodiesIfFewElseATenthOfTheContacts) {
  EXPECT_EQ(BounceLimit(kAutoBounceLimit, 5, 1000), 5);
  EXPECT_EQ(BounceLimit(kAutoBounceLimit, 49, 1000), 49);
  EXPECT_EQ(BounceLimit(kAutoBounceLimit, 50, 1000), 100);
  EXPECT_EQ(BounceLimit(0, 5, 1000), 0);
  EXPECT_EQ(BounceLimit(7, 500, 1000), 7);
}

TEST(SequentialResolver, TwoBallsByHand) {
  Group g = OfficeToy(2, 1);
  g.contacts[0].restitution = 0.5;
  EXPECT_EQ(g.Resolve(), 1);
  EXPECT_NEAR(g.bodies[0].linear_velocity_W.x(), 0.25, 1e-15);
  EXPECT_NEAR(g.bodies[1].linear_velocity_W.x(), 0.75, 1e-15);
  EXPECT_NEAR(g.impulses[0][0], 0.75, 1e-15);
}

// T12: k balls in, k balls out, after k (n - k) bounces.
TEST(SequentialResolver, OfficeToyPassesTheMomentumOnExactly) {
  for (const int n : {3, 5, 10}) {
    for (const int k : {1, 2}) {
      Group g = OfficeToy(n, k);
      g.settings.bounce_limit = 1000;
      EXPECT_EQ(g.Resolve(), k * (n - k)) << n << " " << k;
      for (int i = 0; i < n; ++i)
        EXPECT_NEAR(g.bodies[i].linear_velocity_W.x(), i < n - k ? 0 : 1, 1e-12) << n << " " << k << " " << i;
    }
  }
}

// The paper's own limit is enough for one ball.
TEST(SequentialResolver, AutomaticLimitIsEnoughForOneIncomingBall) {
  for (const int n : {3, 5, 10, 49}) {
    Group g = OfficeToy(n, 1);
    EXPECT_EQ(g.Resolve(), n - 1);
    EXPECT_NEAR(g.bodies[n - 1].linear_velocity_W.x(), 1, 1e-12);
  }
}

TEST(SequentialResolver, BouncesThroughFrozenBodies) {
  Group g = OfficeToy(5, 1);
  for (int i = 1; i < 5; ++i) g.bodies[i].frozen = true;
  EXPECT_EQ(g.Resolve(), 4);
  EXPECT_NEAR(g.bodies[4].linear_velocity_W.x(), 1, 1e-12);
}

TEST(SequentialResolver, StopsAtTheLimit) {
  for (const int limit : {0, 1, 3}) {
    Group g = OfficeToy(10, 1);
    g.settings.bounce_limit = limit;
    EXPECT_EQ(g.Resolve(), limit);
    for (int i = 0; i < 10; ++i) EXPECT_NEAR(g.bodies[i].linear_velocity_W.x(), i == limit ? 1 : 0, 1e-12);
  }
}

TEST(SequentialResolver, FastestFirst) {
  Group g = OfficeToy(4, 0);
  g.contacts.erase(g.contacts.begin() + 1);  // two separate pairs
  g.bodies[0].linear_velocity_W.x() = 1;
  g.bodies[2].linear_velocity_W.x() = 2;
  g.Finish();
  g.settings.bounce_limit = 1;
  EXPECT_EQ(g.Resolve(), 1);
  EXPECT_EQ(g.bodies[1].linear_velocity_W.x(), 0);
  EXPECT_NEAR(g.bodies[3].linear_velocity_W.x(), 2, 1e-15);
}

TEST(SequentialResolver, LeavesSlowApproachesToTheStaticProblem) {
  Group g = OfficeToy(3, 1);
  EXPECT_EQ(g.Resolve(1.0), 0);  // not faster than the threshold
  EXPECT_EQ(g.Resolve(0.999), 2);
}

TEST(SequentialResolver, KinematicWallPushesButNeverMoves) {
  Group g = OfficeToy(2, 0);
  g.bodies[0].kind = BodyKind::kKinematic;
  g.bodies[0].linear_velocity_W.x() = 2;
  g.Finish();
  EXPECT_EQ(g.Resolve(), 1);
  EXPECT_EQ(g.bodies[0].linear_velocity_W.x(), 2);
  EXPECT_NEAR(g.bodies[1].linear_velocity_W.x(), 4, 1e-15);
}

TEST(SequentialResolver, KeepsMomentumAndImpulsesAddUp) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    Group g = RandomGroup(seed, 20, 0, 0.4, 0.6);
    g.settings.bounce_limit = 200;
    g.settings.bounce_law = static_cast<BounceLaw>(seed % 3);
    const std::vector<Body> before = g.bodies;
    const Vector3 momentum = testing::Momentum(g.bodies), angular = testing::AngularMomentum(g.bodies);
    EXPECT_GT(g.Resolve(), 0);
    EXPECT_LT((testing::Momentum(g.bodies) - momentum).norm(), 1e-11);
    EXPECT_LT((testing::AngularMomentum(g.bodies) - angular).norm(), 1e-11);
    std::vector<Body> replayed = before;  // velocity changes are linear in the impulses: the order does not matter
    for (size_t c = 0; c < g.contacts.size(); ++c) {
      const Vector3 impulse = g.frames[c] * g.impulses[c];
      replayed[g.contacts[c].body_a].ApplyImpulse(-impulse, g.contacts[c].point_W);
      replayed[g.contacts[c].body_b].ApplyImpulse(impulse, g.contacts[c].point_W);
    }
    for (size_t i = 0; i < before.size(); ++i) {
      EXPECT_LT((replayed[i].linear_velocity_W - g.bodies[i].linear_velocity_W).norm(), 1e-10);
      EXPECT_LT((replayed[i].angular_velocity_W - g.bodies[i].angular_velocity_W).norm(), 1e-10);
    }
  }
}

TEST(SequentialResolver, ExactLawNeverRaisesEnergyAndEndsWithoutApproach) {
  int ended = 0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    Group g = RandomGroup(100 + seed, 12, 3, seed % 2 ? 0.5 : 5.0, 1.0);
    g.settings.bounce_limit = 5000;
    const double before = g.KineticEnergy();
    const int bounces = g.Resolve(1e-6);
    EXPECT_LE(g.KineticEnergy(), before * (1 + 1e-12)) << seed;
    if (bounces < 5000) {
      ++ended;
      EXPECT_LE(g.FastestApproach(), 1e-6) << seed;
    }
    for (int wall = 0; wall < 3; ++wall) EXPECT_TRUE(g.bodies[wall].linear_velocity_W.isZero(0));
  }
  EXPECT_GT(ended, 40);
}

// The edge of a rod strikes a floor by two points at once, and slips so that Newton's rebound with friction that sticks would make energy. Both
// together get the friction after which the least is left: that at which the mean slip is zero.
TEST(SequentialResolver, TiesThatWouldStickWithEnergyGetTheFrictionThatLeavesLeast) {
  const double x = -0.28, z = -0.44, spin = 0.09;  // of the points; moment of inertia about y
  Group g;
  Body floor, rod;
  floor.kind = BodyKind::kFixed;
  rod.inertia_B = Vector3(spin, spin, spin).asDiagonal();
  rod.linear_velocity_W = {0.5, 0, -1};
  g.bodies = {floor, rod};
  for (const double y : {-0.1, 0.1})
    g.contacts.push_back({.body_a = 0,
                          .body_b = 1,
                          .point_W = {x, y, z},
                          .normal_W = Vector3::UnitZ(),
                          .friction = 1,
                          .restitution = 1});
  g.Finish();
  const double before = g.KineticEnergy();
  g.Resolve();
  // [1/kg] velocity of the points by impulses (across, up) at both.
  const double across = 1 + z * z / spin, mixed = -x * z / spin, up = 1 + x * x / spin;
  const double smooth = 0.5 + mixed * 2 / up, least = -(0.5 + smooth) / (2 * (across - mixed * mixed / up));
  Vector3 sum = Vector3::Zero();
  for (size_t c = 0; c < 2; ++c) sum += g.frames[c] * g.impulses[c];
  EXPECT_GT(std::abs(least), 0.05);
  EXPECT_NEAR(sum.x(), least, 1e-5);
  EXPECT_NEAR(sum.z(), (2 - mixed * least) / up, 1e-5);
  EXPECT_LT(g.KineticEnergy(), before);
}

// A ball that spins in a corner of floor and wall with friction 1, which wedges it: no impulses at both at once give Newton's rebound, and those of a
// little less friction are without bound. It bounces at one after the other.
TEST(SequentialResolver, WedgesBounceOneAfterTheOther) {
  Group g;
  Body corner, ball;
  corner.kind = BodyKind::kFixed;
  ball.mass = 4;
  ball.inertia_B = 0.4 * ball.mass * 0.01 * Matrix3::Identity();
  ball.linear_velocity_W = {0.27, -0.02, -0.27};
  ball.angular_velocity_W = {-1, 0.5, 0.06};
  g.bodies = {corner, ball};
  for (const Vector3& normal : {Vector3(0, 0, 1), Vector3(-1, 0, 0)})
    g.contacts.push_back({.body_a = 0,
                          .body_b = 1,
                          .point_W = -0.1 * normal,
                          .normal_W = normal,
                          .friction = 1,
                          .restitution = normal.z() > 0 ? 0.2 : 0});
  g.Finish();
  const double before = g.KineticEnergy(), momentum = ball.mass * ball.linear_velocity_W.norm();
  g.Resolve();
  for (size_t c = 0; c < 2; ++c) {
    EXPECT_LT(g.impulses[c].norm(), 2 * momentum);
    EXPECT_GT(NormalVelocity(g.contacts[c], g.bodies[0], g.bodies[1]), -1e-9);
  }
  EXPECT_LT(g.KineticEnergy(), before);
}

// Numbers of bodies that belong to other groups must not confuse the resolver, nor what an earlier group left in it.
TEST(SequentialResolver, GroupsOfOneWorldAreIndependent) {
  Group g = OfficeToy(6, 1);
  g.contacts.erase(g.contacts.begin() + 2);  // balls 0-2 and 3-5
  g.bodies[3].linear_velocity_W.x() = 5;
  g.Finish();
  const std::vector<int> first{0, 1, 2}, second{3, 4, 5}, first_contacts{0, 1}, second_contacts{2, 3};
  const ContactFrames frames{g.contacts, g.frames};
  EXPECT_EQ(g.resolver.Resolve(second, second_contacts, frames, BounceLaw::kExact, {1e-9}, g.bodies, g.impulses), 2);
  EXPECT_NEAR(g.bodies[0].linear_velocity_W.x(), 1, 0);
  EXPECT_EQ(g.resolver.Resolve(first, first_contacts, frames, BounceLaw::kExact, {1e-9}, g.bodies, g.impulses), 2);
  EXPECT_NEAR(g.bodies[2].linear_velocity_W.x(), 1, 1e-12);
  EXPECT_NEAR(g.bodies[5].linear_velocity_W.x(), 5, 1e-12);
}

TEST(SequentialResolver, AllocatesNothingAfterWarmUp) {
  Group g = RandomGroup(7, 20, 3, 0.4, 0.6);
  const std::vector<Body> start = g.bodies;
  g.Resolve();
  std::copy(start.begin(), start.end(), g.bodies.begin());
  const testing::AllocationCounter counter;
  EXPECT_GT(g.Resolve(), 0);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet
