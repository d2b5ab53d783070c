// Impacts at their moments, rebounds within a step, bounces at once, in whole steps.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "engine/impact/bounce.h"
#include "engine/world.h"
#include "tests/support/no_alloc.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::Ball;
using testing::Cube;
using testing::Energy;
using testing::Floor;
using testing::kGravity;

// The n-th bounce is at sqrt(2 h / g) (1 + 2 (e + ... + e^(n-1))): seen in the phase of the flight after it.
TEST(Impact, BouncesHappenAtTheirTimesWhateverTheStep) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    World world(Awake());
    world.Add(Floor(0, 0.8));
    world.Add(Ball({0, 0, 1.5}, 0.5, 0, 0.8));
    double rise = std::sqrt(2 / kGravity), apex = 0, last = 0;
    for (int bounces = 0; bounces < 6 && world.time() < 10;) {
      testing::Step(&world, dt);
      const double speed = world.body(1).linear_velocity_W.z();
      if (last < 0 && speed > 0) {
        ++bounces;
        apex += 1.8 * rise;
        rise *= 0.8;
        EXPECT_NEAR(world.time() + speed / kGravity, apex, 1e-5) << dt << " " << bounces;
      }
      last = speed;
    }
  }
}

// Of two mirror images that meet by an edge each moves as it would at a smooth wall, whatever their friction. No face of either is between
// them, and none may decide.
TEST(Impact, MirrorImagesMeetAsAtASmoothWall) {
  const Vector3 half(0.1, 0.15, 0.2);
  std::vector<Vector3> corners;
  for (int c = 0; c < 8; ++c)
    corners.push_back(half.cwiseProduct(Vector3(c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1)));
  for (const Shape& shape : {Shape::Box(half), Shape::ConvexHull(corners)})
    for (const double e : {0.0, 0.3, 1.0})
      for (const double tilt : {0.2, 0.6}) {
        const double reach = half.x() * std::cos(tilt) + half.z() * std::sin(tilt);
        const auto at = [&](double side, double friction) {
          BodyDefinition box{.shape = shape};
          box.position_W = {side * (reach + 0.3), 0, 0};
          box.rotation_WB = Quaternion(Eigen::AngleAxisd(side * tilt, Vector3::UnitY()));
          box.linear_velocity_W = {-2 * side, 0, 0};
          box.mass = 1;
          box.friction = friction;
          box.restitution = e;
          return box;
        };
        Settings settings = Awake();
        settings.gravity = Vector3::Zero();
        for (const double dt : {1.0 / 30, 1.0 / 240}) {
          World wall(settings), pair(settings);
          BodyDefinition smooth{.shape = Shape::HalfSpace()};
          smooth.kind = BodyKind::kFixed;
          smooth.rotation_WB = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitY()));
          smooth.friction = 0;
          smooth.restitution = e;
          wall.Add(smooth);
          wall.Add(at(1, 0));
          pair.Add(at(1, 0.5));
          pair.Add(at(-1, 0.5));
          for (int i = 0; i < 0.25 / dt; ++i) testing::Step(&wall, dt), testing::Step(&pair, dt);
          const Body &alone = wall.body(1), &right = pair.body(0), &left = pair.body(1);
          EXPECT_LT((right.linear_velocity_W - alone.linear_velocity_W).norm(), 1e-6) << e << ' ' << tilt << ' ' << dt;
          EXPECT_NEAR(right.angular_velocity_W.y(), alone.angular_velocity_W.y(), 1e-5);
          EXPECT_NEAR(left.angular_velocity_W.y(), -right.angular_velocity_W.y(), 1e-9);
          EXPECT_NEAR(left.linear_velocity_W.x(), -right.linear_velocity_W.x(), 1e-9);
        }
      }
}

// The same by a corner or a rim, whose sides look anywhere: mirror images stay so.
TEST(Impact, MirrorImagesMeetByCornersAndRims) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 40; ++k) {
    const Shape shape = k % 2 ? Shape::Cylinder(0.12, 0.15) : Shape::Box({0.1, 0.15, 0.2});
    const Quaternion turned = Quaternion(normal(random), normal(random), normal(random), normal(random)).normalized();
    for (const double dt : {1.0 / 30, 1.0 / 240}) {
      Settings settings = Awake();
      settings.gravity = Vector3::Zero();
      World world(settings);
      for (const double side : {1.0, -1.0}) {
        BodyDefinition box{.shape = shape};
        box.position_W = {side * 0.5, 0, 0};
        box.rotation_WB = {turned.w(), turned.x(), side * turned.y(), side * turned.z()};
        box.linear_velocity_W = {-2 * side, 0.1, 0.2};
        box.mass = 1;
        box.friction = 0.5;
        box.restitution = 0.3;
        world.Add(box);
      }
      for (int i = 0; i < 0.3 / dt; ++i) testing::Step(&world, dt);
      const Vector3 right = world.body(0).linear_velocity_W, left = world.body(1).linear_velocity_W;
      EXPECT_GT(right.x(), -1.9);  // they met
      EXPECT_LT((right - Vector3(-left.x(), left.y(), left.z())).norm(), 3e-6) << k << ' ' << dt;
      const Vector3 w = world.body(0).angular_velocity_W, of_left = world.body(1).angular_velocity_W;
      EXPECT_LT((w - Vector3(of_left.x(), -of_left.y(), -of_left.z())).norm(), 3e-5) << k << ' ' << dt;
    }
  }
}

// A long side that comes down flat on a lying cylinder or capsule meets it at both ends at once, by a face or by an edge, and does not yaw.
TEST(Impact, FlatLandingsOnLyingBodiesAreSymmetric) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(-1, 1);
  for (int k = 0; k < 40; ++k) {
    World world(Awake());
    BodyDefinition lying{.shape = k % 2 ? Shape::Cylinder(0.15, 0.15) : Shape::Capsule(0.15, 0.15)};
    lying.rotation_WB = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitX()));
    lying.kind = k % 4 < 2 ? BodyKind::kFixed : BodyKind::kDynamic;
    lying.friction = k % 8 < 4 ? 0.5 : 0.2;
    lying.restitution = 0.3;
    BodyDefinition box{.shape = Shape::Box({0.1 + 0.05 * any(random), 0.1 + 0.04 * any(random), 0.1})};
    box.rotation_WB = Quaternion(Eigen::AngleAxisd(any(random), Vector3::UnitY()));
    box.position_W = {0.1 * any(random), 0, 0.6};
    box.linear_velocity_W = {0.3 * any(random), 0, -2};
    box.angular_velocity_W = {0, 3 * any(random), 0};
    box.friction = lying.friction;
    box.restitution = lying.restitution;
    world.Add(lying);
    world.Add(box);
    for (int i = 0; i < 15; ++i) testing::Step(&world, 1.0 / 60);
    const Vector3& w = world.body(1).angular_velocity_W;
    EXPECT_LT(std::hypot(w.x(), w.z()), 1e-4) << k;
    EXPECT_GT(world.body(1).linear_velocity_W.z(), -4.4) << k;  // they met
  }
}

// The end of a ridge that falls on the middle of another ridge, all in one plane, stays in it.
TEST(Impact, CornersOnEdgesKeepTheirPlane) {
  std::vector<Vector3> roof;
  for (const double x : {-0.15, 0.15}) {
    for (const double y : {-0.1, 0.1}) roof.emplace_back(x, y, 0);
    roof.emplace_back(x, 0, 0.1);
  }
  for (const double tilt : {1.8, 2.2, 2.6}) {
    World world(Awake());
    BodyDefinition lower{.shape = Shape::ConvexHull(roof)}, upper{.shape = lower.shape};
    lower.kind = BodyKind::kFixed;
    lower.friction = upper.friction = 0.5;
    upper.rotation_WB = Quaternion(Eigen::AngleAxisd(tilt, Vector3::UnitY()));
    upper.position_W = {0.02, 0, 0.4};
    upper.mass = 1;
    world.Add(lower);
    world.Add(upper);
    for (int i = 0; i < 20; ++i) testing::Step(&world, 1.0 / 60);
    EXPECT_LT(std::abs(world.body(1).position_W.y()), 1e-6) << tilt;
    EXPECT_GT(world.body(1).linear_velocity_W.z(), -2.5) << tilt;  // they met
  }
}

// A rod leans with its foot on a belt that starts: friction wedges it (Painleve), so that no finite force lets its foot slip. It stops the slip
// at once, like a blow without restitution, whatever the step.
TEST(Impact, WedgedFootStopsItsSlip) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240, 1.0 / 1000})
    for (const double speed : {3.0, -1.0}) {
      const double angle = 0.7, radius = 0.005, half = 0.5;
      World world(Awake());
      BodyDefinition floor = Floor(2.5);
      world.Add(floor);
      BodyDefinition rod{.shape = Shape::Capsule(radius, half)};
      rod.position_W = {0, 0, radius + half * std::sin(angle)};
      rod.rotation_WB =
          Quaternion(Eigen::AngleAxisd((speed > 0 ? 1 : -1) * (std::numbers::pi / 2 - angle), Vector3::UnitY()));
      rod.mass = 1;
      rod.friction = 2.5;
      world.Add(rod);
      world.SetSurfaceVelocity(0, {speed, 0, 0});
      testing::Step(&world, dt);
      const Body& body = world.body(1);
      const Vector3 foot = body.rotation_WB * Vector3(0, 0, -half) - Vector3(0, 0, radius);
      const double slip = body.linear_velocity_W.x() + body.angular_velocity_W.cross(foot).x() - speed;
      EXPECT_LT(std::abs(slip), 4 * dt * std::abs(speed)) << dt << ' ' << speed;
    }
}

// An elastic plate that falls flat from one edge keeps its energy, whatever the moment of the step in which it lands.
TEST(Impact, ElasticPlateSlapsFlat) {
  const double hx = 0.3, hz = 0.03, spin = 5;
  for (int k = 0; k < 60; ++k) {
    const double tilt = 0.165 + 0.0003 * k;
    World world(Awake());
    world.Add(Floor(0, 1));
    BodyDefinition plate{.shape = Shape::Box({hx, 0.4, hz})};
    plate.rotation_WB = Quaternion(Eigen::AngleAxisd(tilt, Vector3::UnitY()));
    plate.position_W.z() = hx * std::sin(tilt) + hz * std::cos(tilt);
    plate.angular_velocity_W.y() = -spin;
    plate.linear_velocity_W.z() = -spin * (hx * std::cos(tilt) - hz * std::sin(tilt));
    plate.mass = 1;
    plate.friction = 0;
    plate.restitution = 1;
    world.Add(plate);
    const double start = Energy(world.bodies());
    for (int i = 0; i < 2; ++i) testing::Step(&world, 1.0 / 30);
    EXPECT_GT(Energy(world.bodies()), 0.9 * start) << tilt;
  }
}

// A tall box rocks from one edge over to the other as far whatever its speed along a smooth floor is.
TEST(Impact, RockingDoesNotDependOnASpeedAlong) {
  for (const double dt : {1.0 / 30, 1.0 / 60})
    for (int k = 0; k < 40; ++k) {
      const double tilt = 0.02 + 0.001 * k;
      double farthest[3] = {0, 0, 0};
      for (int u = 0; u < 3; ++u) {
        World world(Awake());
        world.Add(Floor(0, 0));
        BodyDefinition box{.shape = Shape::Box({0.05, 0.1, 0.4})};
        box.rotation_WB = Quaternion(Eigen::AngleAxisd(tilt, Vector3::UnitY()));
        box.position_W.z() = 0.4 * std::cos(tilt) + 0.05 * std::sin(tilt);
        box.linear_velocity_W.x() = 60.0 * (u - 1);
        box.mass = 1;
        box.friction = 0;
        world.Add(box);
        for (int i = 0; i < 0.5 / dt; ++i) {
          testing::Step(&world, dt);
          farthest[u] = std::min(farthest[u], 2 * std::asin(world.body(1).rotation_WB.y()));
        }
      }
      EXPECT_LT(farthest[1], -0.7 * tilt) << tilt << ' ' << dt;
      for (const double with_speed : farthest) EXPECT_NEAR(with_speed, farthest[1], 2e-5) << tilt << ' ' << dt;
    }
}

// A box that slides and lands on its corners is rubbed by all of each blow. The problem of four corners that hit at once missed its tolerance
// (1e-9 of the approach) by a little, and was answered without friction.
TEST(Impact, BlowsOfWhatSlidesHaveTheirFriction) {
  constexpr double kFriction = 0.2, kStep = 1.0 / 30;
  World world(Awake());
  world.Add(Floor(kFriction, 0.3));
  BodyDefinition box{.shape = Shape::Box({0.19022008540306745, 0.12740176933928168, 0.1154010496715734})};
  box.mass = 1;
  box.friction = kFriction;
  box.restitution = 0.3;
  box.position_W = {0.06642547206651309, -4.509879360213141e-06, 0.11762354741791672};
  box.rotation_WB = {0.9895878278505255, -0.0008004292689513611, 0.005762965700322651, 0.14381265072795701};
  box.linear_velocity_W = {1.9763876848989637, -0.0005147360552219243, -0.20890810293361534};
  box.angular_velocity_W = {0.4155345978078769, -1.1063539312293813, 0.06744724074920977};
  world.Add(box);
  testing::Step(&world, kStep);
  const Vector3 change = world.body(1).linear_velocity_W - box.linear_velocity_W;
  const double pressed = change.z() + kGravity * kStep;  // [m/s] by 1 kg
  EXPECT_GT(pressed, 0.4);
  EXPECT_NEAR(change.x(), -kFriction * pressed, 1e-3 * pressed);
}

// A slab that rises under a tilted plate at rest, without weight, takes it along as it would be taken if it fell on the slab.
TEST(Impact, RisingSlabTakesAWeightlessPlateAlong) {
  for (int k = 1; k <= 40; ++k) {
    const double tilt = 0.005 * k;
    Settings settings = Awake();
    settings.gravity = Vector3::Zero();
    World world(settings);
    BodyDefinition slab{.shape = Shape::Box({3, 3, 0.5})}, plate{.shape = Shape::Box({0.3, 0.3, 0.02})};
    slab.kind = BodyKind::kKinematic;
    slab.position_W.z() = -0.5;
    slab.linear_velocity_W.z() = 2;
    slab.friction = plate.friction = 0;
    plate.rotation_WB = Quaternion(Eigen::AngleAxisd(tilt, Vector3::UnitX()));
    plate.position_W.z() = 0.3 * std::sin(tilt) + 0.02 * std::cos(tilt);
    plate.mass = 1;
    world.Add(slab);
    world.Add(plate);
    for (int i = 0; i < 8; ++i) EXPECT_LT(testing::Step(&world, 1.0 / 30).penetration_max, 1e-5) << tilt << ' ' << i;
    EXPECT_GT(world.body(1).linear_velocity_W.z(), 1.9) << tilt;
  }
}

// Two planks that tip towards each other meet edge on edge while their feet rub: what the feet do in the piece moves the blow, and it is
// struck where the edges are then. By a face's normal, a hair apart, one would be thrown up and the other down.
TEST(Impact, PlanksThatTipMeetByTheirEdges) {
  std::mt19937 random(4);
  const auto between = [&](double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random);
  };
  for (int k = 0; k < 30; ++k) {
    const Vector3 half(between(0.015, 0.05), between(0.1, 0.3), 0.5);
    const double lean = between(0.02, 0.15) + 2.4 * half.x(), apart = std::sin(lean) + between(0.05, 0.4);
    World world(Awake());
    world.Add(Floor(0.8, 0.2));
    for (const double side : {-1.0, 1.0}) {
      BodyDefinition plank{.shape = Shape::Box(half)};
      plank.rotation_WB = Quaternion(Eigen::AngleAxisd(-side * lean, Vector3::UnitY()));
      plank.position_W = Vector3(side * apart, 0, 0) - plank.rotation_WB * Vector3(-side * half.x(), 0, -half.z());
      plank.friction = 0.8;
      plank.restitution = 0.2;
      world.Add(plank);
    }
    for (int i = 0; i < 120; ++i) testing::Step(&world, 1.0 / 60);
    const Vector3 left = world.body(1).position_W, right = world.body(2).position_W;
    EXPECT_LT((right - Vector3(-left.x(), left.y(), left.z())).norm(), 1e-6) << k;
    EXPECT_GT(right.z(), 0.4) << k;
  }
}

// Two planks that lean against each other by an edge hold each other up without any friction there.
TEST(Impact, PlanksLeanOnEachOtherBySmoothEdges) {
  for (const double lean : {0.2, 0.5})
    for (const double dt : {1.0 / 60, 1.0 / 240}) {
      World world(Awake());
      world.Add(Floor(2));
      const Vector3 half(0.03, 0.2, 0.5);
      for (const double side : {1.0, -1.0}) {
        BodyDefinition plank{.shape = Shape::Box(half)};
        plank.rotation_WB = Quaternion(Eigen::AngleAxisd(-side * lean, Vector3::UnitY()));
        plank.position_W = {side * (half.z() * std::sin(lean) + half.x() * std::cos(lean)), 0,
                            half.z() * std::cos(lean) + half.x() * std::sin(lean)};
        plank.mass = 1;
        plank.friction = 2;
        world.Add(plank);
      }
      world.SetMaterialCallback([](const Contact& c, const Body&, const Body&) -> Material {
        return {c.body_a == 0 ? 2.0 : 0.0, 0};
      });
      const Vector3 start = world.body(1).position_W;
      for (int i = 0; i < 1 / dt; ++i) testing::Step(&world, dt);
      EXPECT_LT((world.body(1).position_W - start).norm(), 1e-9) << lean << ' ' << dt;
    }
}

TEST(Impact, ZenosBallComesToRestOnTime) {
  for (const double dt : {1.0 / 60, 1.0 / 240}) {
    for (const double e : {0.3, 0.7, 0.95}) {
      World world(Awake());
      world.Add(Floor(0, e));
      world.Add(Ball({0, 0, 0.6}, 0.5, 0, e));
      const double end = std::sqrt(0.2 / kGravity) * (1 + e) / (1 - e);
      double moved = 0;
      while (world.time() < end + 0.5) {
        testing::Step(&world, dt);
        if (world.body(1).linear_velocity_W.norm() > 1e-6) moved = world.time();
      }
      EXPECT_NEAR(moved, end, 2 * dt) << dt << " " << e;
      EXPECT_NEAR(world.body(1).position_W.z(), 0.5, 1e-5);
    }
  }
}

// Bounces shorter than a frame: no speed below which e = 1 would be forgotten.
TEST(Impact, ElasticBallNeverStopsHoweverLowItBounces) {
  World world(Awake());
  world.Add(Floor(0, 1));
  BodyDefinition ball = Ball({0, 0, 0.5}, 0.5, 0, 1), cube = Cube({3, 0, 0.5}, 0, 1);
  ball.linear_velocity_W.z() = -std::sqrt(2e-5 * kGravity);
  cube.linear_velocity_W.z() = -std::sqrt(2e-4 * kGravity);
  world.Add(ball);
  world.Add(cube);
  const double start = Energy(world.bodies());
  for (int i = 0; i < 600; ++i) testing::Step(&world, 1.0 / 60);
  EXPECT_NEAR(Energy(world.bodies()), start, 1e-10);
  EXPECT_NEAR(std::abs(world.body(1).linear_velocity_W.z()), std::sqrt(2e-5 * kGravity), 2e-4);
}

// A ball that left the floor at 0.01 m/s and is back: it began the step with that speed, and it takes no memory to know it.
// As in the paper: no impact rules of ours.
TEST(Impact, PaperHasNoReboundsWithinAStep) {
  Settings settings = Settings::Paper();
  settings.threads = 1;
  World world(settings);
  world.Add(Floor(0, 1));
  BodyDefinition ball = Ball({0, 0, 0.5}, 0.5, 0, 1);
  ball.linear_velocity_W.z() = -0.01;
  world.Add(ball);
  testing::StepTimes(&world, 3);
  EXPECT_NEAR(world.body(1).linear_velocity_W.z(), 0, 1e-9);
}

// Both roll or lie on the floor. They used to be slowed down in the step before they met.
TEST(Impact, SupportedBallsMeetAtFullSpeed) {
  for (const double dt : {1.0 / 60, 1.0 / 240}) {
    World world(Awake());
    world.Add(Floor(0, 0));
    BodyDefinition ball = Ball({0, 0, 0.5}, 0.5, 0, 1);
    world.Add(Ball({1.513, 0, 0.5}, 0.5, 0, 1));
    testing::StepTimes(&world, 10, dt);
    ball.linear_velocity_W = {3, 0, 0};
    ball.restitution = 1;
    world.Add(ball);
    testing::StepTimes(&world, static_cast<int>(0.5 / dt), dt);
    EXPECT_NEAR(world.body(1).linear_velocity_W.x(), 3, 1e-9) << dt;
    EXPECT_NEAR(world.body(2).linear_velocity_W.x(), 0, 1e-9) << dt;
  }
}

// Weight does not end a blow that is level. (What is brief was judged by the whole weight: below 5 mm/s at 1/30 s balls on a floor ended
// with one velocity, a row of ten below 10.)
TEST(Impact, SlowLevelBlowsKeepTheirRebound) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    for (const double restitution : {0.5, 1.0}) {
      for (const double speed : {0.01, 1e-3, 3e-4}) {
        for (const int count : {2, 10}) {
          if (count > 2 && restitution < 1) continue;
          World world(Awake());
          world.Add(Floor(0, 0));
          for (int i = 0; i < count; ++i) world.Add(Ball({1.001 * i, 0, 0.5}, 0.5, 0, restitution));
          world.SetVelocity(1, {speed, 0, 0}, Vector3::Zero());
          for (int step = 0; step < 1.3e-3 * (count - 1) / speed / dt + 2; ++step)
            EXPECT_FALSE(world.Step(dt).Failed());
          EXPECT_NEAR(world.body(count).linear_velocity_W.x(), 0.5 * (1 + restitution) * speed, 1e-6 * speed)
              << dt << " " << restitution << " " << speed << " " << count;
        }
      }
    }
  }
}

// The second is at rest when the step begins, and its gap to the third is less than gravity closes in a step. The blow sets it
// going, and its load must not brake it before it hits. (Half of the energy was lost.)
TEST(Impact, BlowIsPassedOnOverAGapThatTheNextStepCloses) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    for (const double gap : {1.1e-3, 2e-3, 5e-3}) {
      World world(Awake());
      world.Add(Floor(0, 0));
      world.Add(Ball({1.3, 0, 0.5}, 0.5, 0, 1));
      world.Add(Ball({2.3 + gap, 0, 0.5}, 0.5, 0, 1));
      testing::StepTimes(&world, 10, dt);
      BodyDefinition ball = Ball({0, 0, 0.5}, 0.5, 0, 1);
      ball.linear_velocity_W = {3, 0, 0};
      world.Add(ball);
      testing::StepTimes(&world, static_cast<int>(0.5 / dt), dt);
      EXPECT_NEAR(world.body(3).linear_velocity_W.x(), 0, 1e-9) << dt << " " << gap;
      EXPECT_NEAR(world.body(1).linear_velocity_W.x(), 0, 1e-9) << dt << " " << gap;
      EXPECT_NEAR(world.body(2).linear_velocity_W.x(), 3, 1e-9) << dt << " " << gap;
    }
  }
}

// The same with a wall: a cube at rest in front of it is hit, rebounds from it with all four corners at once, and hits the ball
// that stands where it was hit.
TEST(Impact, CubeThatABlowSendsAgainstAWallRebounds) {
  for (const double e : {0.3, 1.0}) {
    constexpr double kDt = 1.0 / 60;
    World world(Awake());
    world.Add(Floor(0, 0));
    world.Add(
        {.shape = Shape::Box({0.5, 2, 2}), .kind = BodyKind::kFixed, .position_W = {2.002, 0, 2}, .restitution = e});
    world.Add(Cube({1, 0, 0.5}, 0, 0));
    testing::StepTimes(&world, 10, kDt);
    BodyDefinition ball = Ball({-0.3, 0, 0.5}, 0.5, 0, 1);
    ball.linear_velocity_W = {3, 0, 0};
    world.Add(ball);
    testing::StepTimes(&world, 10, kDt);
    EXPECT_NEAR(world.body(3).linear_velocity_W.x(), -3 * e, 1e-9) << e;
    EXPECT_NEAR(world.body(2).linear_velocity_W.norm(), 0, 1e-9) << e;
    EXPECT_NEAR(world.body(2).angular_velocity_W.norm(), 0, 1e-9) << e;
  }
}

// What gravity gives in the part of the step that an impact cuts off comes with the next flight: the floor feels m g t.
TEST(Impact, NoTimeIsLost) {
  World world(Awake());
  world.Add(Floor(0, 0.5));
  world.Add(Ball({0, 0, 1.5}, 0.5, 0, 0.5));
  double impulse = 0;
  while (world.time() < 3 - 1e-9) {
    testing::Step(&world, 1.0 / 60);
    impulse += testing::ImpulseOn(world, 1).z();
  }
  EXPECT_NEAR(impulse / (3 * kGravity), 1, 1e-6);
}

// A front of two through a row of eight takes 16 bounces, more than there are bodies.
TEST(Impact, AutomaticLimitLetsTwoBallsThroughARow) {
  Settings settings = Awake();
  settings.gravity.setZero();
  World world(settings);
  for (int i = 0; i < 10; ++i) {
    BodyDefinition ball = Ball({i + (i > 1 ? 0.3 : 0), 0, 0}, 0.5, 0, 1);
    if (i < 2) ball.linear_velocity_W = {1, 0, 0};
    world.Add(ball);
  }
  testing::StepTimes(&world, 60);
  for (int i = 0; i < 10; ++i) EXPECT_NEAR(world.body(i).linear_velocity_W.x(), i < 8 ? 0 : 1, 1e-12) << i;
}

// The four corners hit at once; one after the other they would make it spin.
TEST(Impact, FlatLandingDoesNotSpin) {
  for (const double friction : {0.0, 0.5}) {
    World world(Awake());
    world.Add(Floor(friction, 0.7));
    world.Add(Cube({0.3, 0.2, 1.5}, friction, 0.7));
    for (int i = 0; i < 120; ++i) {
      testing::Step(&world, 1.0 / 60);
      ASSERT_LT(world.body(1).angular_velocity_W.norm(), 1e-9) << friction << " " << i;
    }
  }
}

// Kane's paradox: where friction would add energy the rebound is still Newton's. It used to be lowered.
// A box that touches the floor gets a spin: one of its edges leaves, the other strikes. With half an extent a, mass m, inertia 2/3 m a^2 the
// edge strikes at a w, and takes m (1 + e) a w / 2.5.
TEST(Impact, KickedBoxStrikesWithOneEdgeWhileTheOtherLeaves) {
  constexpr double kHalf = 0.1, kSpin = 30;
  for (const double restitution : {0.0, 0.2, 0.5, 1.0}) {
    for (const double rate : {60.0, 240.0, 4000.0}) {
      Settings settings = Awake();
      settings.gravity.setZero();
      World world(settings);
      world.Add(Floor(0, restitution));
      BodyDefinition box = Cube({0, 0, kHalf}, 0, restitution);
      box.shape = Shape::Box({kHalf, kHalf, kHalf});
      box.mass = 1;
      box.angular_velocity_W = {0, kSpin, 0};
      world.Add(box);
      testing::Step(&world, 1 / rate);
      const double impulse = (1 + restitution) * kHalf * kSpin / 2.5;
      EXPECT_NEAR(world.body(1).linear_velocity_W.z(), impulse, 1e-6) << restitution << " " << rate;
      EXPECT_NEAR(world.body(1).angular_velocity_W.y(), kSpin - 1.5 / kHalf * impulse, 1e-5) << restitution << rate;
    }
  }
}

// A can lands flat while it moves to a side, and its rim grips. After the blow it tips about two points of the rim, and the lowest one between
// them, which was no contact, meets the floor at once. It ends alike at any step.
TEST(Impact, CanThatTripsEndsAlikeAtAnyStep) {
  for (const double speed : {2.0, 3.0}) {
    Vector3 finest = Vector3::Zero();
    for (const double rate : {960.0, 240.0, 60.0, 30.0}) {
      World world(Awake());
      world.Add(Floor(1.5, 0));
      BodyDefinition can{.shape = Shape::Cylinder(0.05, 0.05),
                         .mass = 0.1,
                         .position_W = {0, 0, 0.1},
                         .friction = 1.5,
                         .restitution = 0};
      can.rotation_WB = testing::Turn(0.5, Vector3::UnitZ());
      can.linear_velocity_W = {-speed, 0, 0};
      world.Add(can);
      testing::StepTimes(&world, static_cast<int>(std::lround(0.2 * rate)), 1 / rate);
      if (rate == 960) finest = world.body(1).linear_velocity_W;
      EXPECT_LT((world.body(1).linear_velocity_W - finest).norm(), 5e-3) << speed << " " << rate;  // before: 3
    }
  }
}

// A heavy box hits a ball off its centre, drives it to a wall and squeezes it out there; nothing rebounds, nothing rubs. What pressed a pair
// that comes apart within a piece presses it no more.
TEST(Impact, BallIsSqueezedOutAlikeAtAnyStep) {
  for (int phase = 0; phase < 6; ++phase) {
    for (const double rate : {30.0, 60.0, 240.0}) {
      Settings settings = Awake();
      settings.gravity.setZero();
      World world(settings);
      world.Add({.shape = Shape::Box({0.1, 0.5, 0.3}),
                 .kind = BodyKind::kFixed,
                 .position_W = {0.6, 0, 0},
                 .friction = 0,
                 .restitution = 0});
      world.Add({.shape = Shape::Box({0.05, 0.05, 0.1}),
                 .mass = 5,
                 .position_W = {-0.25 - 0.016 * phase, 0, 0},
                 .linear_velocity_W = {3, 0, 0},
                 .friction = 0,
                 .restitution = 0});
      const int ball = world.Add(
          {.shape = Shape::Sphere(0.1), .mass = 1, .position_W = {0.05, 0.02, 0}, .friction = 0, .restitution = 0});
      testing::StepTimes(&world, static_cast<int>(std::lround(0.3 * rate)), 1 / rate);
      EXPECT_NEAR(world.body(ball).linear_velocity_W.y(), 2.1148, 3e-3) << phase << " " << rate;  // before: up to 3.2
    }
  }
}

TEST(Impact, BouncesThatWouldGainEnergyKeepNewtonsLaw) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> uniform(-1, 1), share(0.05, 1);
  const Matrix3 frame = ContactFrame(Vector3::UnitZ());
  for (int trial = 0; trial < 20000; ++trial) {
    BounceBody body{.inverse_mass = share(rng)};
    body.inverse_inertia_W = Vector3(share(rng), share(rng), share(rng)).asDiagonal();
    body.inverse_inertia_W *= 10;
    body.linear_velocity_W = 5 * Vector3(uniform(rng), uniform(rng), uniform(rng));
    body.angular_velocity_W = 5 * Vector3(uniform(rng), uniform(rng), uniform(rng));
    const Contact contact{.body_a = 0,
                          .body_b = 1,
                          .point_W = {uniform(rng), uniform(rng), uniform(rng)},
                          .normal_W = Vector3::UnitZ(),
                          .friction = 2 * share(rng),
                          .restitution = 1};
    const double approach = -body.VelocityAt(contact.point_W).z();
    if (approach <= 0) continue;
    const auto energy = [&] {
      return 0.5 * body.linear_velocity_W.squaredNorm() / body.inverse_mass +
             0.5 * body.angular_velocity_W.dot(body.inverse_inertia_W.inverse() * body.angular_velocity_W);
    };
    const double before = energy();
    const Vector3 j = BounceImpulse({}, body, contact, frame, BounceLaw::kExact);
    body.ApplyImpulse(frame * j, contact.point_W);
    EXPECT_NEAR(body.VelocityAt(contact.point_W).z(), approach, 1e-9 * (1 + approach)) << trial;
    EXPECT_LE(energy(), before * (1 + 1e-12)) << trial;
    EXPECT_LE(j.tail<2>().norm(), contact.friction * j[0] * (1 + 1e-9)) << trial;
  }
}

// Also where boxes hit in the middle of a step, stick together and are moved apart.
TEST(Impact, FreeCloudKeepsAngularMomentum) {
  for (const double restitution : {0.0, 0.5, 1.0}) {
    Settings settings = Awake();
    settings.gravity.setZero();
    World world(settings);
    std::mt19937 rng(4);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int i = 0; i < 27; ++i) {
      const Vector3 place(2.0 * (i % 3 - 1), 2.0 * (i / 3 % 3 - 1), 2.0 * (i / 9 - 1));
      BodyDefinition body = Cube(place, 0.5, restitution);
      body.shape = Shape::Box({0.4, 0.5, 0.6});
      body.linear_velocity_W = -2 * place + Vector3(uniform(rng), uniform(rng), uniform(rng));
      body.angular_velocity_W = 3 * Vector3(uniform(rng), uniform(rng), uniform(rng));
      world.Add(body);
    }
    const Vector3 start = testing::AngularMomentum(world.bodies());
    double energy = Energy(world.bodies(), 0);
    for (int frame = 0; frame < 120; ++frame) {
      testing::Step(&world, 1.0 / 60);
      EXPECT_LE(Energy(world.bodies(), 0), energy * (1 + 1e-12)) << restitution << " " << frame;
      energy = Energy(world.bodies(), 0);
    }
    EXPECT_LT((testing::AngularMomentum(world.bodies()) - start).norm(), 1e-10) << restitution;
  }
}

// A plank tips and slides over the edge of a block as a ball hits it. The edge bears it at another place at once, so its gap opens and closes as
// the step ends; even so it takes part in the blow.
TEST(Impact, SupportThatSlidesTakesPartInABlow) {
  const auto ball_after = [](double dt, double first, double restitution) -> Vector3 {
    World world(Awake());
    world.Add({.shape = Shape::Box({0.03, 0.3, 0.15}),
               .kind = BodyKind::kFixed,
               .position_W = {0, 0, 0.15},
               .friction = 0.2,
               .restitution = restitution});
    world.Add({.shape = Shape::Box({0.5, 0.1, 0.03}),
               .mass = 3,
               .position_W = {0.08, 0, 0.33},
               .friction = 0.2,
               .restitution = restitution});
    BodyDefinition ball = Ball({0, 0, 1}, 0.05, 0.2, restitution);
    ball.mass = 0.1;
    const int struck = world.Add(ball);
    double left = 0.42 - first;  // [s]
    for (testing::Step(&world, first); left > 1e-12; left -= dt) testing::Step(&world, std::min(dt, left));
    return world.body(struck).linear_velocity_W;
  };
  for (const double restitution : {0.3, 0.8}) {
    const Vector3 fine = ball_after(1.0 / 1000, 1.0 / 1000, restitution);
    for (int k = 0; k < 12; ++k)
      EXPECT_LT((ball_after(1.0 / 60, (k + 0.5) / 720, restitution) - fine).norm(), 0.01) << restitution << " " << k;
  }
}

// A box lies with its face on the edge of a ridge, leaves it slowly, moves along and turns: the ridge meets the face again in the same step, up
// to 4 % of a size deep on a free way that parts from it before the step ends.
TEST(Impact, WhatPartsMayMeetAgainWithinTheStep) {
  struct Way {
    double along, spin, leaves, dt;
  };
  for (const Way& way : {Way{3, -6, 0.01, 1.0 / 30}, Way{12, -25, 0.1, 1.0 / 120}, Way{24, -50, 0.1, 1.0 / 240}}) {
    const auto box_after = [&](int steps) {
      World world(Awake());
      world.Add({.shape = Shape::Box({0.1, 0.5, 0.1}),
                 .kind = BodyKind::kFixed,
                 .position_W = {0, 0, -0.1 * std::sqrt(2.0)},
                 .rotation_WB = testing::Turn(M_PI / 4, Vector3::UnitY()),
                 .friction = 0,
                 .restitution = 0});
      const int box = world.Add({.shape = Shape::Box({0.05, 0.05, 0.05}),
                                 .mass = 1,
                                 .position_W = {0, 0, 0.05},
                                 .linear_velocity_W = {way.along, 0, way.leaves},
                                 .angular_velocity_W = {0, way.spin, 0},
                                 .friction = 0,
                                 .restitution = 0});
      for (int k = 0; k < steps; ++k) testing::Step(&world, way.dt / steps);
      return world.body(box);
    };
    const Body fine = box_after(64), coarse = box_after(1);
    EXPECT_NEAR(coarse.angular_velocity_W.y(), fine.angular_velocity_W.y(), -0.02 * way.spin) << way.along;
    EXPECT_NEAR(coarse.linear_velocity_W.z(), fine.linear_velocity_W.z(), 0.08) << way.along;
  }
}

// A plank leans on a box that lies on the floor. It turns about one corner, sets out slowly, and lands on its edge beside that: it turns on about
// the next corner, as it does in finer steps.
TEST(Impact, PlankThatRocksGoesOnAboutTheNextCorner) {
  const auto plank_after = [](double dt, int steps) {
    World world(Awake());
    world.Add(Floor(0.6, 0.3));
    world.Add(
        {.shape = Shape::Box({0.08, 0.02, 0.02}),
         .mass = 0.256,
         .position_W = {-0.193417381950, 0.246495553614, 0.020000006235},
         .rotation_WB = Quaternion(-0.552661191425, -0.552661163271, -0.441095800289, -0.441096067832).normalized(),
         .friction = 0.125,
         .restitution = 0.32});
    const int plank = world.Add(
        {.shape = Shape::Box({0.02, 0.02, 0.1}),
         .mass = 0.32,
         .position_W = {-0.091627241668, 0.292565579259, 0.043648523307},
         .rotation_WB = Quaternion(-0.591372630407, -0.187360876324, -0.761170508122, 0.189192419497).normalized(),
         .linear_velocity_W = {0.001132982226, 0.004457147911, -0.001028228992},
         .angular_velocity_W = {-0.213271624871, 0.066858217676, 0.054816588039},
         .friction = 0.125,
         .restitution = 0.32});
    for (int k = 0; k < steps; ++k) testing::Step(&world, dt / steps);
    return world.body(plank).angular_velocity_W;
  };
  for (const double dt : {1.0 / 60, 1.0 / 80}) {
    const Vector3 fine = plank_after(dt, 32);
    for (const int steps : {1, 2, 4}) EXPECT_LT((plank_after(dt, steps) - fine).norm(), 0.01) << dt << " " << steps;
  }
}

// A box spins on a smooth pillar, edge on edge. From where the step begins nothing seems to have to press: on its free way it would go
// 1 % of a size through the edge and come out at the side of the pillar.
TEST(Impact, EdgeGoesNotThroughAnEdge) {
  const auto box_after = [](int steps) {
    World world(Awake());
    world.Add({.shape = Shape::Box({0.1, 0.1, 0.24960824017795596}),
               .kind = BodyKind::kFixed,
               .position_W = {-0.010928318013, 0, 0},
               .rotation_WB = testing::Turn(1.91612242, Vector3::UnitZ()),
               .friction = 0});
    const int box = world.Add({.shape = Shape::Box({0.1398215964313683, 0.0851645532390696, 0.08624087170617956}),
                               .mass = 1,
                               .position_W = {-0.228786913139, 0.011602639469, 0.390200006033},
                               .rotation_WB = {-0.810541347679, -0.556180429082, -0.182578207071, 0.018741726501},
                               .linear_velocity_W = {-0.942244501515, -0.019704334853, -2.004546541384},
                               .angular_velocity_W = {21.093566855899, 2.302979957853, 3.094379594481},
                               .friction = 0});
    for (int k = 0; k < steps; ++k) testing::Step(&world, 1.0 / 120 / steps);
    return world.body(box);
  };
  const Body fine = box_after(32);
  for (const int steps : {1, 2, 4}) {
    const Body box = box_after(steps);
    EXPECT_LT((box.linear_velocity_W - fine.linear_velocity_W).norm(), 0.01) << steps;
    EXPECT_LT((box.angular_velocity_W - fine.angular_velocity_W).norm(), 0.1) << steps;
  }
  EXPECT_GT(fine.linear_velocity_W.z(), -1.8);  // falling freely: -2.09
}

// What lies 1e-6 of its size deep in level tiles slides from tile to tile: an edge that comes under it is met by its side, and their faces keep
// them apart. Each was thrown up at the first tile in a third of such steps and more.
TEST(Impact, LevelTilesTripNobody) {
  constexpr double kTile = 0.05, kHeight = 0.05;
  std::vector<Vector3> corners;
  for (int k = 0; k < 7; ++k)
    for (const double z : {-kHeight, kHeight})
      corners.emplace_back(0.08 * std::cos(2 * std::numbers::pi * k / 7), 0.08 * std::sin(2 * std::numbers::pi * k / 7),
                           z);
  const Shape shapes[] = {Shape::Box({0.1, 0.07, kHeight}), Shape::Cylinder(0.07, kHeight), Shape::ConvexHull(corners)};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const double rate : {30.0, 60.0, 240.0}) {
    for (int k = 0; k < 30; ++k) {
      World world(Awake());
      for (int i = -4; i <= 4; ++i)
        for (int j = -4; j <= 4; ++j)
          world.Add({.shape = Shape::Box({0.5 * kTile, 0.5 * kTile, 0.5}),
                     .kind = BodyKind::kFixed,
                     .position_W = {i * kTile, j * kTile, -0.5},
                     .friction = 0});
      const int slider = world.Add({.shape = shapes[k % 3],
                                    .mass = 1,
                                    .position_W = {0.03 * uniform(random), 0.03 * uniform(random), kHeight - 2e-7},
                                    .rotation_WB = Quaternion(Eigen::AngleAxisd(3 * uniform(random), Vector3::UnitZ())),
                                    .linear_velocity_W = {1, 0, 0},
                                    .angular_velocity_W = {0, 0, 3 * uniform(random)},
                                    .friction = 0});
      world.Step(1 / rate);
      EXPECT_NEAR(world.body(slider).linear_velocity_W.x(), 1, 1e-3) << rate << " " << k;
      EXPECT_LT(world.body(slider).angular_velocity_W.head<2>().norm(), 1e-3) << rate << " " << k;
    }
  }
}

// A smooth body of 4 cm that slides along x over level floor, turned by `yaw` about z, onto a slab that rises by `rise` and begins `deep` below
// the floor's end. Returns how much of its energy is left after a tenth of a second.
double EnergyPastSeam(const Settings& settings, const Shape& slider, double dt, double speed, double rise, double yaw,
                      double deep, bool hull) {
  constexpr double kHalf = 0.02, kSlab = 0.5;
  World world(settings);
  const auto add = [&](const Shape& shape, const Vector3& at, const Quaternion& rotation) {
    world.Add({.shape = shape,
               .kind = BodyKind::kFixed,
               .position_W = at,
               .rotation_WB = rotation,
               .friction = 0,
               .restitution = 0});
  };
  add(Shape::Box({kSlab, 1, 0.2}), {-kSlab, 0, -0.2}, Quaternion::Identity());
  if (hull) {
    std::vector<Vector3> corners;
    for (const double y : {-1.0, 1.0})
      for (const Vector3& c : {Vector3(0, y, 0), Vector3(1, y, 0), Vector3(1, y, std::tan(rise))}) corners.push_back(c);
    const Shape wedge = Shape::ConvexHull(corners);
    add(wedge, wedge.hull_offset(), Quaternion::Identity());
  } else {
    const Quaternion tilt = testing::Turn(-rise, Vector3::UnitY());
    add(Shape::Box({kSlab, 1, 0.2}), tilt * Vector3(kSlab, 0, -0.2) - Vector3(0, 0, deep), tilt);
  }
  world.Add({.shape = slider,
             .mass = 1,
             .position_W = {-0.11, 0, kHalf},
             .rotation_WB = testing::Turn(yaw, Vector3::UnitZ()),
             .linear_velocity_W = {speed, 0, 0},
             .friction = 0,
             .restitution = 0});
  const double before = Energy(world.bodies());
  for (int i = 0; i < std::lround(0.1 / dt); ++i) EXPECT_FALSE(world.Step(dt).Failed()) << dt;
  const double least = kHalf * kGravity;
  return (Energy(world.bodies()) - least) / (before - least);
}

// Where two floors meet flush, what slides over the seam touches both by a corner, and could part from the second one along any direction between
// their sides. It goes where it closes least: on the ramp's face, or straight on over a crest. By the middle of all these directions it lost
// half to three quarters of its energy, at any step.
TEST(Impact, SeamsTripNobody) {
  const Shape cube = Shape::Box({0.02, 0.02, 0.02}), puck = Shape::Cylinder(0.02, 0.02);
  for (const double dt : {1.0 / 30, 1.0 / 240, 1.0 / 1000}) {
    for (const double rise : {0.005, 0.02, 0.1, 0.2, -0.05, -0.3}) {
      const double speed = rise > 0 ? 2 : 0.8;
      for (const double yaw : {0.0, 1e-6, 0.3}) {
        const double lower = EnergyPastSeam(Awake(), cube, dt, speed, rise, yaw, 1e-5, false);
        EXPECT_GT(lower, 0.8);
        for (const bool hull : {false, true}) {
          if (hull && rise < 0) continue;
          EXPECT_NEAR(EnergyPastSeam(Awake(), cube, dt, speed, rise, yaw, 0, hull), lower, 6e-3)
              << dt << " " << rise << " " << yaw;
        }
      }
      const double of_box = EnergyPastSeam(Awake(), puck, dt, speed, rise, 0, 0, false);
      EXPECT_GT(of_box, 0.9) << dt << " " << rise;
      if (rise > 0) {
        EXPECT_NEAR(EnergyPastSeam(Awake(), puck, dt, speed, rise, 0, 0, true), of_box, 6e-3) << dt << rise;
      }
    }
  }
  // A crowd's step that begins with the corner on the seam, as 45 steps of 2 mm get there.
  EXPECT_GT(EnergyPastSeam(testing::AsCrowd(Awake()), cube, 1e-3, 2, 0.1, 0, 0, false), 0.98);
}

// What falls on the seam of two level floors by an edge, a corner or a ball's side rebounds as from one: a smooth floor gives it no speed along.
// So do two slabs that lie on the floor, and are heavier.
TEST(Impact, DropsOnASeamGoStraightUp) {
  const struct {
    Shape shape;
    double angle, lowest, x;  // [rad] about y; [m] of the centre above the lowest point; that one's place
  } kCases[] = {{Shape::Box({0.1, 0.07, 0.05}), 0.2, 0.1 * std::sin(0.2) + 0.05 * std::cos(0.2), 0},
                {Shape::Box({0.1, 0.07, 0.05}), M_PI / 4, (0.1 + 0.05) * std::sqrt(0.5), 0},
                {Shape::Sphere(0.1), 0, 0.1, -1e-3},
                {Shape::Sphere(0.1), 0, 0.1, -2e-4}};
  for (const auto& [shape, angle, lowest, x] : kCases) {
    for (const double restitution : {0.0, 1.0}) {
      for (const auto& [along, heavy] : {std::pair{0.0, false}, {0.5, false}, {0.0, true}}) {
        World world(Awake());
        for (const double side : {-1.0, 1.0})
          world.Add({.shape = Shape::Box({1, 1, 0.2}),
                     .kind = heavy ? BodyKind::kDynamic : BodyKind::kFixed,
                     .mass = 10,
                     .position_W = {side, 0, -0.2},
                     .friction = 0,
                     .restitution = restitution});
        world.Add({.shape = Shape::Box({5, 5, 0.2}),
                   .kind = BodyKind::kFixed,
                   .position_W = {0, 0, -0.6},
                   .friction = 0,
                   .restitution = 0});
        const Quaternion turn = testing::Turn(angle, Vector3::UnitY());
        const Vector3 corner = angle == 0 ? Vector3(0, 0, -lowest) : turn * Vector3(0.1, 0, -0.05);
        constexpr double kFall = 1e-3;  // [s]
        const int body = world.Add({.shape = shape,
                                    .mass = 1,
                                    .position_W = Vector3(x - along * kFall - corner.x(), 0, -corner.z() + 3 * kFall),
                                    .rotation_WB = turn,
                                    .linear_velocity_W = {along, 0, -3 + kGravity * kFall / 2},
                                    .friction = 0,
                                    .restitution = restitution});
        for (int i = 0; i < 4; ++i) EXPECT_FALSE(world.Step(1e-3 / 2).Failed());
        EXPECT_GT(world.body(body).linear_velocity_W.z(), -2.9) << "it has hit";
        EXPECT_NEAR(world.body(body).linear_velocity_W.x(), along, 1e-5) << angle << " " << restitution << " " << x;
      }
    }
  }
}

// A polygonal dish that a smooth cube slides along: at a seam of angle d it loses no more than about d^2, some 1 % of it in all here.
TEST(Impact, FacetsOfADishTripNobody) {
  constexpr double kRadius = 2, kHalf = 0.02, kReach = 1.2, kStart = 0.5;
  for (const auto& [rate, facets] :
       {std::pair{30.0, 36}, std::pair{60.0, 48}, std::pair{60.0, 96}, std::pair{240.0, 96}}) {
    World world(Awake());
    const double facet = 2 * kReach / facets;
    const auto turn = [](double angle) { return testing::Turn(-angle, Vector3::UnitY()); };
    for (int k = 0; k < facets; ++k) {
      const double angle = -kReach + (k + 0.5) * facet;
      world.Add({.shape = Shape::Box({kRadius * std::tan(0.5 * facet), 1, 0.2}),
                 .kind = BodyKind::kFixed,
                 .position_W = Vector3(0, 0, kRadius) + turn(angle) * Vector3(0, 0, -kRadius - 0.2),
                 .rotation_WB = turn(angle),
                 .friction = 0,
                 .restitution = 0});
    }
    world.Add({.shape = Shape::Box({kHalf, 0.1, kHalf}),
               .mass = 1,
               .position_W = Vector3(0, 0, kRadius) + turn(kStart) * Vector3(0, 0, -kRadius + kHalf + 1.5e-4),
               .rotation_WB = turn(kStart),
               .friction = 0,
               .restitution = 0});
    const double least = kGravity * kHalf, before = Energy(world.bodies()) - least;
    for (int i = 0; i < 2 * rate; ++i) EXPECT_FALSE(world.Step(1 / rate).Failed()) << rate;
    EXPECT_GT(Energy(world.bodies()) - least, 0.9 * before) << rate << " " << facets;
  }
}

// A smooth hull rattles out on a blade that turns, presses, and is then hit by the blade's end, all in one step. What pressed is no longer near by
// then. The blow has its rebound as in finer steps.
TEST(Impact, TheEndOfABladeHitsWhatPressesOnIt) {
  const std::vector<Vector3> corners = {{0.014362, 0.12572, 0.057837},     {-0.076269, -0.030499, 0.047645},
                                        {-0.089285, -0.040014, -0.011638}, {-0.110002, -0.101779, -0.153138},
                                        {0.029385, -0.05241, 0.039718},    {0.063444, -0.018846, -0.100258},
                                        {0.095005, 0.060511, 0.137735}};
  const auto after = [&](double restitution, int steps) {
    Settings settings = Awake();
    settings.gravity.setZero();
    World world(settings);
    world.Add({.shape = Shape::Box({0.5, 0.02, 0.3}),
               .kind = BodyKind::kKinematic,
               .position_W = {0, 0, 0.32},
               .rotation_WB = Quaternion(0.99938961, 0, 0, 0.03493432).normalized(),
               .angular_velocity_W = {0, 0, -8.1868},
               .friction = 0,
               .restitution = restitution});
    world.Add({.shape = Shape::ConvexHull(corners),
               .mass = 0.3,
               .position_W = {0.618563, -0.050454, 0.512197},
               .rotation_WB = Quaternion(-0.09753911, -0.86264439, -0.15325871, -0.47206201).normalized(),
               .linear_velocity_W = {3.339826, -3.415263, -0.661775},
               .angular_velocity_W = {3.932894, -1.434013, -0.878359},
               .friction = 0,
               .restitution = restitution});
    for (int i = 0; i < steps; ++i) testing::Step(&world, 1.0 / 60 / steps);
    return world.body(1);
  };
  for (const double restitution : {0.05, 0.2, 0.3, 0.4, 0.5}) {
    const Body one = after(restitution, 1), fine = after(restitution, 16);
    EXPECT_LT((one.linear_velocity_W - fine.linear_velocity_W).norm(), 1e-3) << restitution;
    EXPECT_LT((one.angular_velocity_W - fine.angular_velocity_W).norm(), 1e-2) << restitution;
  }
}

// Plain hulls that meet in free space without a rebound roll and slide on each other: what closes from rest, as normals turn, presses. It is no
// blow, or they would be cut into pieces without end.
TEST(Impact, WhatClosesFromRestIsNoBlow) {
  const auto around = [](int sides, double radius, double z) {
    std::vector<Vector3> ring;
    for (int k = 0; k < sides; ++k) {
      const double angle = 2 * std::numbers::pi * k / sides;
      ring.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
    return ring;
  };
  std::vector<std::vector<Vector3>> hulls;
  for (const double top : {0.0, 0.4, 0.7})
    for (const int sides : {3, 4, 5}) {
      std::vector<Vector3> hull = around(sides, 0.7, -0.4);
      if (top == 0) hull.push_back({0, 0, 0.6});
      for (const Vector3& corner : top > 0 ? around(sides, top, 0.4) : std::vector<Vector3>{}) hull.push_back(corner);
      hulls.push_back(hull);
    }
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto any = [&] { return Vector3(uniform(rng), uniform(rng), uniform(rng)); };
  Settings settings = Awake();
  settings.gravity.setZero();
  int gave_up = 0;
  for (int pair = 0; pair < 40; ++pair) {
    World world(settings);
    for (const double side : {0.0, 2.2}) {
      BodyDefinition body{.shape = Shape::ConvexHull(hulls[rng() % hulls.size()]), .mass = 1 + side};
      body.position_W = {side, 0, 0};
      body.rotation_WB = Quaternion(Eigen::AngleAxisd(3 * uniform(rng), any().normalized()));
      body.linear_velocity_W = {-1.6 * side, 0, 0};
      body.angular_velocity_W = 4 * any();
      body.friction = 0;
      body.restitution = 0;
      world.Add(body);
    }
    bool gives_up = false;
    for (int i = 0; i < 60; ++i) gives_up = world.Step(1.0 / 60).gave_up > 0 || gives_up;
    gave_up += gives_up;
  }
  EXPECT_LE(gave_up, 3);
}

// A box that stands on its edge, and turns about it, is hit by a smooth ball with e = 1. All the energy stays, so a piece may seem to gain by
// rounding and is solved once more. The ball rebounds all the same.
TEST(Impact, ElasticBlowOfWhatStandsOnItsEdgeRebounds) {
  const Vector3 half(0.3, 0.4, 0.4);
  const double angle = 0.02 - std::atan(half.x() / half.z());
  for (const double rate : {15.0, 30.0, 60.0, 240.0})
    for (const double share : {0.1, 0.3, 0.6, 0.9}) {
      const auto after = [&](int steps) {
        World world(Awake());
        world.Add(Floor(0, 0));
        const Quaternion turn = testing::Turn(angle, Vector3::UnitY());
        const Vector3 foot = turn * Vector3(half.x(), 0, -half.z()), other = turn * Vector3(-half.x(), 0, -half.z()),
                      lowest = foot.z() < other.z() ? foot : other, side = turn * Vector3::UnitX();
        BodyDefinition box{.shape = Shape::Box(half), .mass = 1, .friction = 0, .restitution = 0};
        box.position_W.z() = -lowest.z();
        box.rotation_WB = turn;
        box.angular_velocity_W = Vector3::UnitY();
        box.linear_velocity_W = -box.angular_velocity_W.cross(lowest);
        world.Add(box);
        BodyDefinition ball =
            Ball(box.position_W + turn * Vector3(half.x(), 0, -0.3) + (0.05 + 2 * share / rate) * side, 0.05, 0, 1);
        ball.mass = 1;
        ball.linear_velocity_W = -2 * side;
        world.Add(ball);
        for (int i = 0; i < steps; ++i) testing::Step(&world, 1 / rate / steps);
        return world.body(2).linear_velocity_W;
      };
      EXPECT_LT((after(1) - after(8)).norm(), 5e-3) << rate << " " << share;
    }
}

// A superball that spins towards a wall wedges between it and the floor: both at once have no answer. It leaves as one that falls a hair beside
// the wall.
TEST(Impact, SuperballAlongAWallBouncesAsBesideIt) {
  for (const bool crowd : {false, true}) {
    std::vector<Vector3> left;
    for (const double beside : {0.0, 1e-7, 1e-4}) {
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      world.Add(Floor(2, 1));
      world.Add({.shape = Shape::HalfSpace(),
                 .kind = BodyKind::kFixed,
                 .rotation_WB = testing::Turn(0.5 * M_PI, Vector3::UnitY()),
                 .friction = 2,
                 .restitution = 1});
      BodyDefinition ball = Ball({0.1 + beside, 0, 0.2}, 0.1, 2, 1);
      ball.linear_velocity_W = {0, 0, -4};
      ball.angular_velocity_W = {0, -40, 0};
      const int superball = world.Add(ball);
      for (int k = 0; k < 6; ++k) testing::Step(&world, 1.0 / 120);
      left.push_back(world.body(superball).linear_velocity_W);
    }
    EXPECT_GT(left[2].z(), 2) << crowd;
    for (const Vector3& other : left) EXPECT_LT((other - left[2]).norm(), 0.01) << crowd << ": " << other.transpose();
  }
}

}  // namespace
}  // namespace islet
