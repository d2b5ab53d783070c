#include "engine/response/response.h"

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "engine/response/suite_frame.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::kGravity;
using testing::Turn;

constexpr double kDt = 1.0 / 60;
constexpr Model kModels[] = {Model::kKinetic, Model::kConvex, Model::kCoulomb};

// One island: bodies, contacts, and the two problems on it.
struct Island {
  std::vector<Body> bodies;
  std::vector<Contact> contacts;
  std::vector<Matrix3> frames;
  std::vector<Vector3> impulses;
  std::vector<int> members, numbers;
  Settings settings;
  IslandResponder responder;

  void Begin() {
    frames.clear(), members.clear();
    for (const Contact& c : contacts) frames.push_back(ContactFrame(c.normal_W));
    impulses.assign(contacts.size(), Vector3::Zero());
    for (size_t i = 0; i < bodies.size(); ++i)
      if (bodies[i].Moves()) members.push_back(static_cast<int>(i));
    numbers.resize(contacts.size());
    std::iota(numbers.begin(), numbers.end(), 0);
  }
  ResponseOutcome Collide() {
    Begin();
    return responder.ResolveCollisions({members, numbers}, {contacts, frames}, settings, kGravity * kDt, 1e-9, bodies,
                                       impulses);
  }
  ResponseOutcome Rest() {  // velocities must hold gravity already
    Begin();
    return responder.ResolveStatic({members, numbers}, {contacts, frames}, settings, kGravity * kDt, kDt, bodies,
                                   impulses);
  }
  void AddGravity(const Vector3& gravity = {0, 0, -kGravity}) {
    for (Body& b : bodies)
      if (b.Moves()) b.linear_velocity_W += kDt * gravity;
  }
  double KineticEnergy() const {
    double sum = 0;
    for (const Body& b : bodies) sum += b.Moves() ? b.KineticEnergy() : 0;
    return sum;
  }
};

Body Wall() {
  Body wall;
  wall.kind = BodyKind::kFixed;
  return wall;
}

// A cube of side 1 and 1 kg, turned about y.
Body UnitCube(const Vector3& position, double turn = 0) {
  Body cube;
  cube.inertia_B = Matrix3::Identity() / 6;
  cube.position_W = position;
  cube.rotation_WB = Turn(turn, Vector3::UnitY());
  return cube;
}

// Four corners of a face with normal `up`, between bodies a (below) and b.
void AddFace(Island* island, int a, int b, const Vector3& centre, double turn, double friction,
             double restitution = 0) {
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5})
      island->contacts.push_back({.body_a = a,
                                  .body_b = b,
                                  .point_W = centre + Turn(turn, Vector3::UnitY()) * Vector3(x, y, 0),
                                  .normal_W = Turn(turn, Vector3::UnitY()) * Vector3::UnitZ(),
                                  .friction = friction,
                                  .restitution = restitution});
}

// A cube on a plane that falls towards +x at angle `turn`.
Island CubeOnPlane(double friction, double turn = 0) {
  Island island;
  island.bodies = {Wall(), UnitCube(Turn(turn, Vector3::UnitY()) * Vector3(0, 0, 0.5), turn)};
  AddFace(&island, 0, 1, Vector3::Zero(), turn, friction);
  return island;
}

// A point mass on a plane: the contact at the centre of mass, no lever.
Island PointOnPlane(double friction, const Vector3& velocity) {
  Island island;
  island.bodies = {Wall(), UnitCube(Vector3::Zero())};
  island.bodies[1].linear_velocity_W = velocity;
  island.contacts = {{.body_a = 0, .body_b = 1, .normal_W = Vector3::UnitZ(), .friction = friction}};
  return island;
}

// The simultaneous answer to Newton's cradle: (-1/3, 2/3, 2/3) v.                                    [SM04 Fig. 3b]
TEST(ResolveCollisions, ThreeBallCradleSimultaneously) {
  for (const Model model : {Model::kConvex, Model::kCoulomb}) {
    Island row;
    row.settings.model = model;
    for (int i = 0; i < 3; ++i) row.bodies.push_back(UnitCube({static_cast<double>(i), 0, 0}));
    for (int i = 1; i < 3; ++i)
      row.contacts.push_back(
          {.body_a = i - 1, .body_b = i, .point_W = {i - 0.5, 0, 0}, .normal_W = Vector3::UnitX(), .restitution = 1});
    row.bodies[0].linear_velocity_W.x() = 3;
    const ResponseOutcome outcome = row.Collide();
    EXPECT_EQ(outcome.status, QpStatus::kSolved);
    EXPECT_FALSE(outcome.restitution_lowered) << static_cast<int>(model);
    EXPECT_NEAR(row.bodies[0].linear_velocity_W.x(), -1, 1e-6) << static_cast<int>(model);
    EXPECT_NEAR(row.bodies[1].linear_velocity_W.x(), 2, 1e-6);
    EXPECT_NEAR(row.bodies[2].linear_velocity_W.x(), 2, 1e-6);
  }
}

TEST(ResolveCollisions, NothingApproachesNothingHappens) {
  Island island = CubeOnPlane(0.5);
  island.bodies[1].linear_velocity_W = {3, 0, 0};
  EXPECT_EQ(island.Collide().status, QpStatus::kNone);
  EXPECT_EQ(island.bodies[1].linear_velocity_W, Vector3(3, 0, 0));
  for (const Vector3& j : island.impulses) EXPECT_TRUE(j.isZero(0));
}

// Flat drop of a cube: bounces with e, without spin.
TEST(ResolveCollisions, FlatCubeBouncesWithItsRestitution) {
  for (const Model model : kModels) {
    for (const double restitution : {0.0, 0.3, 0.9}) {
      Island island = CubeOnPlane(0.5);
      for (Contact& c : island.contacts) c.restitution = restitution;
      island.settings.model = model;
      island.bodies[1].linear_velocity_W = {0, 0, -2};
      EXPECT_EQ(island.Collide().status, QpStatus::kSolved);
      EXPECT_NEAR(island.bodies[1].linear_velocity_W.z(), 2 * restitution, 1e-5) << static_cast<int>(model);
      EXPECT_NEAR(island.bodies[1].angular_velocity_W.norm(), 0, 1e-5);
    }
  }
}

TEST(ResolveStatic, CubeRestsAndTheFloorCarriesItsWeight) {
  for (const Model model : kModels) {
    Island island = CubeOnPlane(0.5);
    island.settings.model = model;
    island.AddGravity();
    EXPECT_EQ(island.Rest().status, QpStatus::kSolved);
    EXPECT_LT(island.bodies[1].linear_velocity_W.norm(), 1e-6 * kGravity * kDt);
    double sum = 0;
    for (const Vector3& j : island.impulses) sum += j[0];
    EXPECT_NEAR(sum, kGravity * kDt, 1e-6);
  }
}

// T4, T5: what slides must not leave the plane. Point mass, approach w and slip s:
//   Coulomb   u_n = 0, |u_t| = s - mu w
//   convex    the nearest point of K*: |u_t| = (s - mu w) / (1 + mu^2), u_n = mu |u_t|
TEST(ResolveStatic, SlidingPointByEachModel) {
  const double approach = kGravity * kDt;
  for (const double friction : {0.1, 0.5, 1.0}) {
    for (const double slip : {0.5, 6.0}) {
      for (const Model model : kModels) {
        Island island = PointOnPlane(friction, Vector3(slip * 0.6, slip * 0.8, -approach));
        island.settings.model = model;
        EXPECT_EQ(island.Rest().status, QpStatus::kSolved);
        const bool exact = model == Model::kCoulomb;
        const double left = (slip - friction * approach) / (exact ? 1 : 1 + friction * friction);
        const Vector3 expected(0.6 * left, 0.8 * left, exact ? 0 : friction * left);
        EXPECT_LT((island.bodies[1].linear_velocity_W - expected).norm(), 1e-6 * slip)
            << friction << " " << slip << " " << static_cast<int>(model);
      }
    }
  }
}

TEST(ResolveStatic, StickingPointStopsInEveryModel) {
  for (const Model model : kModels) {
    Island island = PointOnPlane(0.5, Vector3(0.04, 0.03, -kGravity * kDt));
    island.settings.model = model;
    island.Rest();
    EXPECT_LT(island.bodies[1].linear_velocity_W.norm(), 1e-6) << static_cast<int>(model);
  }
}

// A whole cube: with four corners the convex optimum lifts off as well, exact Coulomb glides.
TEST(ResolveStatic, SlidingCubeLiftsOffInTheConvexModelsOnly) {
  for (const Model model : kModels) {
    Island island = CubeOnPlane(0.5);
    island.settings.model = model;
    island.bodies[1].linear_velocity_W = {6, 0, 0};
    island.AddGravity();
    island.Rest();
    const Body& cube = island.bodies[1];
    double lowest = 1e9;
    for (const Contact& c : island.contacts) lowest = std::min(lowest, cube.VelocityAt(c.point_W).z());
    if (model == Model::kCoulomb) {
      EXPECT_NEAR(cube.linear_velocity_W.z(), 0, 1e-5);
      EXPECT_NEAR(cube.linear_velocity_W.x(), 6 - 0.5 * kGravity * kDt, 1e-5);
      EXPECT_NEAR(cube.angular_velocity_W.norm(), 0, 1e-4);
    } else {
      EXPECT_GT(cube.linear_velocity_W.z(), 0.5);
      EXPECT_GT(lowest, -1e-5);
    }
  }
}

// T14: contact k of a column carries all that is above it.
TEST(ResolveStatic, ColumnOfTenLoads) {
  for (const Model model : kModels) {
    Island column;
    column.settings.model = model;
    column.bodies.push_back(Wall());
    for (int i = 0; i < 10; ++i) {
      column.bodies.push_back(UnitCube({0, 0, i + 0.5}));
      AddFace(&column, i, i + 1, {0, 0, static_cast<double>(i)}, 0, 0.5);
    }
    column.AddGravity();
    EXPECT_EQ(column.Rest().status, QpStatus::kSolved);
    for (int level = 0; level < 10; ++level) {
      double load = 0;
      for (int corner = 0; corner < 4; ++corner) load += column.impulses[4 * level + corner][0];
      EXPECT_NEAR(load, (10 - level) * kGravity * kDt, 5e-5 * kGravity * kDt) << level;
      EXPECT_LT(column.bodies[level + 1].linear_velocity_W.norm(), 1e-5 * kGravity * kDt);
    }
  }
}

// T15: a heavy cube on a light one.
TEST(ResolveStatic, HeavyOnLight) {
  for (const double ratio : {1.0, 1e2}) {
    Island column;
    column.bodies = {Wall(), UnitCube({0, 0, 0.5}), UnitCube({0, 0, 1.5})};
    column.bodies[2].mass *= ratio;
    column.bodies[2].inertia_B *= ratio;
    AddFace(&column, 0, 1, {0, 0, 0}, 0, 0.5);
    AddFace(&column, 1, 2, {0, 0, 1}, 0, 0.5);
    column.AddGravity();
    const ResponseOutcome outcome = column.Rest();
    EXPECT_EQ(outcome.status, QpStatus::kSolved) << ratio;
    double floor = 0;
    for (int c = 0; c < 4; ++c) floor += column.impulses[c][0];
    EXPECT_NEAR(floor / ((1 + ratio) * kGravity * kDt), 1, 2e-5) << ratio;
    for (const int i : {1, 2})
      EXPECT_LT(column.bodies[i].linear_velocity_W.norm(), 1e-4 * kGravity * kDt) << ratio << " " << i;
  }
}

// T1, T2: tan theta against mu; one step from rest gives g (sin - mu cos) dt along the plane.
TEST(ResolveStatic, InclineSticksBelowAndSlidesAboveTheFrictionAngle) {
  for (const double friction : {0.2, 0.5, 0.9}) {
    for (const double share : {0.5, 0.99, 1.01, 1.5}) {
      const double turn = std::atan(share * friction);
      Island island = CubeOnPlane(friction, turn);
      island.AddGravity();
      island.Rest();
      const double speed = std::max(0.0, kGravity * (std::sin(turn) - friction * std::cos(turn)) * kDt);
      const Vector3 expected = Turn(turn, Vector3::UnitY()) * Vector3(speed, 0, 0);
      EXPECT_LT((island.bodies[1].linear_velocity_W - expected).norm(), 1e-5 * kGravity * kDt)
          << friction << " " << share;
    }
  }
}

// T24: walls that close on a cube.
TEST(ResolveStatic, KinematicSqueezeIsInfeasibleAndFinite) {
  for (const Model model : kModels) {
    Island island;
    island.settings.model = model;
    island.bodies = {Wall(), UnitCube(Vector3::Zero()), Wall()};
    island.bodies[0].kind = island.bodies[2].kind = BodyKind::kKinematic;
    island.bodies[0].linear_velocity_W = {0, 0, 1};
    island.bodies[2].linear_velocity_W = {0, 0, -1};
    AddFace(&island, 0, 1, {0, 0, -0.5}, 0, 0.5);
    AddFace(&island, 1, 2, {0, 0, 0.5}, 0, 0.5);
    island.AddGravity();
    EXPECT_EQ(island.Rest().status, QpStatus::kInfeasible) << static_cast<int>(model);
    EXPECT_TRUE(island.bodies[1].linear_velocity_W.allFinite());
    EXPECT_LT(island.bodies[1].linear_velocity_W.norm(), 3) << static_cast<int>(model);
    for (const Vector3& j : island.impulses) EXPECT_TRUE(j.allFinite());
  }
}

TEST(ResolveCollisions, KinematicSqueezeIsInfeasibleAndFinite) {
  Island island;
  island.bodies = {Wall(), UnitCube(Vector3::Zero()), Wall()};
  island.bodies[0].kind = island.bodies[2].kind = BodyKind::kKinematic;
  island.bodies[0].linear_velocity_W = {0, 0, 1};
  island.bodies[2].linear_velocity_W = {0, 0, -1};
  AddFace(&island, 0, 1, {0, 0, -0.5}, 0, 0.5, 1);
  AddFace(&island, 1, 2, {0, 0, 0.5}, 0, 0.5, 1);
  EXPECT_EQ(island.Collide().status, QpStatus::kInfeasible);
  EXPECT_TRUE(island.bodies[1].linear_velocity_W.allFinite());
}

// A kinematic floor that rises carries its load along.
TEST(ResolveStatic, RisingFloorLiftsTheCube) {
  Island island = CubeOnPlane(0.5);
  island.bodies[0].kind = BodyKind::kKinematic;
  island.bodies[0].linear_velocity_W = {0.3, 0, 0.7};
  island.bodies[1].linear_velocity_W = {0.3, 0, 0.7};
  island.AddGravity();
  EXPECT_EQ(island.Rest().status, QpStatus::kSolved);
  EXPECT_LT((island.bodies[1].linear_velocity_W - Vector3(0.3, 0, 0.7)).norm(), 1e-5);
}

Island RandomCluster(unsigned seed, int n, double friction, double restitution) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Island island;
  for (int i = 0; i < n; ++i) {
    Body body = UnitCube(1.5 * Vector3(uniform(rng), uniform(rng), uniform(rng)));
    body.kind = i == 0 ? BodyKind::kFixed : BodyKind::kDynamic;
    body.mass = std::pow(10, uniform(rng));
    body.inertia_B = Vector3(1, 1.2, 1.5).asDiagonal() * (0.1 * body.mass);
    if (i > 0) {
      body.linear_velocity_W = 3 * Vector3(uniform(rng), uniform(rng), uniform(rng));
      body.angular_velocity_W = 3 * Vector3(uniform(rng), uniform(rng), uniform(rng));
    }
    island.bodies.push_back(body);
  }
  for (int a = 0; a < n; ++a) {
    for (int b = a + 1; b < n; ++b) {
      const Vector3 apart = island.bodies[b].position_W - island.bodies[a].position_W;
      if (apart.norm() > 1.5) continue;
      const Vector3 offset = 0.2 * Vector3(uniform(rng), uniform(rng), uniform(rng));
      island.contacts.push_back({.body_a = a,
                                 .body_b = b,
                                 .point_W = 0.5 * (island.bodies[a].position_W + island.bodies[b].position_W) + offset,
                                 .normal_W = apart.normalized(),
                                 .friction = friction,
                                 .restitution = restitution});
    }
  }
  return island;
}

// Newton's restitution with friction may not create energy, whatever the levers.
TEST(ResolveCollisions, RandomClustersNeverGainEnergy) {
  int lowered = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    for (const Model model : kModels) {
      Island island = RandomCluster(seed, 8, seed % 2 ? 0.5 : 1.5, 1);
      island.settings.model = model;
      const double before = island.KineticEnergy();
      const Vector3 momentum = testing::Momentum(island.bodies);
      const ResponseOutcome outcome = island.Collide();
      if (outcome.status == QpStatus::kNone) continue;
      lowered += outcome.restitution_lowered;
      EXPECT_LE(island.KineticEnergy(), before * (1 + 1e-6))
          << seed << " " << static_cast<int>(model) << " " << ToString(outcome.status);
      EXPECT_LE(outcome.certificate.momentum, 1e-9);
      EXPECT_LE(outcome.certificate.energy_gain, before * 1e-6);
      Vector3 wall_push = Vector3::Zero();
      for (size_t c = 0; c < island.contacts.size(); ++c)
        if (island.contacts[c].body_a == 0) wall_push += island.frames[c] * island.impulses[c];
      EXPECT_LT((testing::Momentum(island.bodies) - momentum - wall_push).norm(), 1e-9 * (1 + momentum.norm()));
    }
  }
  EXPECT_GT(lowered, 0);  // the policy was needed, else this test proves little
}

TEST(ResolveStatic, RandomClustersNeverGainEnergyAndCertify) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    for (const Model model : kModels) {
      Island island = RandomCluster(1000 + seed, 8, 0.6, 0);
      if (island.contacts.empty()) continue;
      island.settings.model = model;
      const double before = island.KineticEnergy();
      const ResponseOutcome outcome = island.Rest();
      EXPECT_LE(island.KineticEnergy(), before * (1 + 1e-9)) << seed;
      if (outcome.status == QpStatus::kNone) continue;
      EXPECT_TRUE(outcome.status == QpStatus::kSolved || outcome.status == QpStatus::kInaccurate) << seed;
      EXPECT_LE(outcome.certificate.momentum, 1e-9) << seed;
      EXPECT_LE(outcome.certificate.cone, 1e-6) << seed;
      EXPECT_LE(outcome.certificate.dual, 1e-3) << seed << " " << static_cast<int>(model);
    }
  }
}

// What an answer has left to approach counts in the map that is told, though the slip that the solver returns makes way for it.
TEST(ResolveStatic, TheMapThatIsToldHidesNoApproach) {
  int hidden = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Island island = RandomCluster(2000 + seed, 60, 0, 0), convex = RandomCluster(2000 + seed, 60, 0, 0);
    island.settings.effort = {1, false};
    convex.settings.model = Model::kConvex;
    const ResponseOutcome outcome = island.Rest(), other = convex.Rest();
    if (outcome.map == 0 || other.map == 0) continue;
    const double v_ref = other.certificate.natural_map_rms / other.map;
    EXPECT_NEAR(outcome.map * v_ref, outcome.certificate.coulomb_map_rms, 1e-9 * outcome.certificate.coulomb_map_rms);
    hidden += outcome.certificate.natural_map_rms < 0.9 * outcome.certificate.coulomb_map_rms;
  }
  EXPECT_GT(hidden, 0);
}

}  // namespace
}  // namespace islet
