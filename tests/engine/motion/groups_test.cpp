// Who shares the pieces of a step: whoever comes near whom, by the ways that they go.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::Ball;
using testing::Cube;
using testing::Floor;

Settings OneThread() {
  Settings settings;
  settings.threads = 1;
  return settings;
}

// A domino rocks back onto its other edge within the step; another stands 18 cm beside it. Together with their floor they move at this speed.
Body RockingDomino(double speed, bool another) {
  World world(Awake());
  BodyDefinition floor = Floor(0.5, 0);
  floor.kind = BodyKind::kKinematic;
  floor.linear_velocity_W = {speed, 0, 0};
  world.Add(floor);
  BodyDefinition domino{.shape = Shape::Box({0.02, 0.1, 0.2}), .mass = 1, .friction = 0.5, .restitution = 0};
  domino.position_W = {0.000341, 0, 0.200121};
  domino.rotation_WB = testing::Turn(2 * std::asin(0.003129), Vector3::UnitY());
  domino.linear_velocity_W = {speed - 0.049787, 0, -0.004664};
  domino.angular_velocity_W = {0, -0.248784, 0};
  const int rocks = world.Add(domino);
  domino.position_W = {0.186466, -0.005704, 0.2};
  domino.rotation_WB = testing::Turn(2 * std::asin(0.056729), Vector3::UnitZ());
  domino.linear_velocity_W = {speed, 0, 0};
  domino.angular_velocity_W = Vector3::Zero();
  if (another) world.Add(domino);
  testing::Step(&world, 1.0 / 30);
  return world.body(rocks);
}

// The boxes that they sweep meet where both are fast. They share no piece even so, or one would miss its landing.
TEST(Groups, WhoComesNearNobodyIsSteppedAlone) {
  for (const double speed : {0.0, 4.0, 20.0}) {
    const Body alone = RockingDomino(speed, false), beside = RockingDomino(speed, true);
    EXPECT_EQ(alone.linear_velocity_W, beside.linear_velocity_W) << speed;
    EXPECT_EQ(alone.angular_velocity_W, beside.angular_velocity_W) << speed;
    EXPECT_NEAR(alone.angular_velocity_W.y(), -0.2796, 2e-4) << speed;  // as by a hundred short steps
  }
}

// A ball leaves its neighbour, rebounds from a wall, and comes back within the step: on its free way it would not. It gives the neighbour all
// that it has, and that one a third.
TEST(Groups, WhoMeetsAfterABlowIsSteppedTogether) {
  constexpr double kSpeed = 6, kRadius = 0.1, kGap = 0.05, kStep = 1.0 / 20;
  for (const bool frozen : {false, true}) {
    Settings settings;
    settings.threads = 1;
    settings.gravity.setZero();
    settings.freezing = frozen ? Freezing::kCertified : Freezing::kOff;
    World world(settings);
    world.Add({.shape = Shape::Box({0.5, 1, 1}),
               .kind = BodyKind::kFixed,
               .position_W = {kRadius + kGap + 0.5, 0, 0},
               .friction = 0,
               .restitution = 1});
    const int first = world.Add(Ball({0, 0, 0}, kRadius, 0, 1));
    const int second = world.Add(Ball({-2 * kRadius - kGap, 0, 0}, kRadius, 0, 1));
    const int third = world.Add(Ball({-4 * kRadius - 2 * kGap, 0, 0}, kRadius, 0, 1));
    if (frozen)
      for (int i = 0; i < 60; ++i) testing::Step(&world, kStep);
    world.SetVelocity(first, {kSpeed, 0, 0}, Vector3::Zero());
    EXPECT_FALSE(world.Step(kStep).Failed());
    EXPECT_NEAR(world.body(first).linear_velocity_W.x(), 0, 1e-9 * kSpeed);
    EXPECT_NEAR(world.body(second).linear_velocity_W.x(), 0, 1e-9 * kSpeed);
    EXPECT_NEAR(world.body(third).linear_velocity_W.x(), -kSpeed, 1e-9 * kSpeed);
    const double way = kSpeed * kStep - 4 * kGap;  // to the wall, back, and over both gaps
    EXPECT_NEAR(world.body(third).position_W.x(), -4 * kRadius - 2 * kGap - way, 1e-9);
  }
}

// A rod is turned by its user from one side of a ball to the other, in one step. It begins and ends beside the ball, at rest.
TEST(Groups, WhoIsTurnedByTheUserMeetsWhatIsOnItsWay) {
  constexpr double kHalf = 0.1, kThin = 0.004, kMass = 0.05;
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    Settings settings = Awake();
    settings.gravity.setZero();
    World world(settings);
    BodyDefinition rod{.shape = Shape::Box({kHalf, kThin, kThin}), .mass = kMass, .friction = 0, .restitution = 0.5};
    rod.rotation_WB = testing::Turn(M_PI / 6, Vector3::UnitZ());
    const int turned = world.Add(rod);
    BodyDefinition ball = Ball({0.97 * kHalf, 0, 0}, 0.004, 0, 0.5);
    ball.mass = 0.005;
    const int met = world.Add(ball);
    const double inertia = kMass * (kHalf * kHalf + kThin * kThin) / 3;
    world.SetForce(turned, Vector3::Zero(), {0, 0, -inertia * 2 * (M_PI / 3) / (dt * dt)});
    EXPECT_FALSE(world.Step(dt).Failed());
    // It meets the ball by its side, where it has turned by that much under a constant torque, as a free rod does.
    const double arm = 0.97 * kHalf, angle = M_PI / 6 - (kThin + 0.004) / arm;
    const double rate = std::sqrt(4 * (M_PI / 3) * angle) / dt, at_ball = 1 / (1 / kMass + arm * arm / inertia);
    EXPECT_NEAR(world.body(met).linear_velocity_W.norm(), 1.5 * rate * arm * at_ball / (at_ball + 0.005),
                0.01 * rate * arm);
  }
}

// A ball flies at the lowest brick of a tower under a force that sends it back: at the end of the step it is where it was, as fast as it was.
double ImpulseOfReturning(double speed, int bricks) {
  constexpr double kStep = 1.0 / 60, kGap = 0.01, kRadius = 0.1;
  World world(Awake());
  world.Add(Floor(0.5, 0));
  for (int i = 0; i < bricks; ++i)
    world.Add({.shape = Shape::Box({0.5, 0.25, 0.25}),
               .mass = 1,
               .position_W = {0, 0, 0.25 + 0.5 * i},
               .friction = 0.5,
               .restitution = 0});
  BodyDefinition ball = Ball({0.5 + kRadius + kGap, 0, 0.25}, kRadius, 0.5, 0);
  ball.mass = 1;
  ball.linear_velocity_W = {-speed, 0, 0};
  const int flies = world.Add(ball);
  world.SetForce(flies, {2 * speed / kStep, 0, -world.settings().gravity.z()}, Vector3::Zero());
  EXPECT_FALSE(world.Step(kStep).Failed());
  const double approach = std::sqrt(speed * speed - 4 * speed / kStep * kGap);
  return (world.body(flies).linear_velocity_W.x() - speed) / (0.5 * approach);  // of what two equal masses exchange
}

TEST(Groups, WhomAForceTurnsBackHitsBefore) {
  for (const int bricks : {1, 3, 8, 12, 16})
    for (const double speed : {3, 5, 8, 20, 40})
      EXPECT_NEAR(ImpulseOfReturning(speed, bricks), 1, 1e-6) << speed << ' ' << bricks;
}

// A crowd may miss a share of the blow: it lasts as long as a part of its step.
TEST(Groups, WhomAForceTurnsBackHitsACrowdBefore) {
  for (const double speed : {5, 8, 20, 40}) EXPECT_NEAR(ImpulseOfReturning(speed, 24), 1, 0.15) << speed;
}

// An elastic ball hits a wall while another one, that comes near both and touches neither, is pulled away.
TEST(Groups, WhatPullsAnotherChangesNoBlow) {
  for (const double pull : {0.0, 1e2, 1e4}) {  // [N]
    Settings settings = Awake();
    settings.gravity.setZero();
    World world(settings);
    world.Add({.shape = Shape::Box({1, 1, 1}),
               .kind = BodyKind::kFixed,
               .position_W = {-1, 0, 0},
               .friction = 0,
               .restitution = 1});
    BodyDefinition ball = Ball({0.105, 0, 0}, 0.1, 0, 1);
    ball.mass = 1;
    ball.linear_velocity_W = {-1, 0, 0};
    const int flies = world.Add(ball);
    ball.position_W.y() = 0.201;
    ball.linear_velocity_W.setZero();
    world.SetForce(world.Add(ball), {pull, 0, 0}, Vector3::Zero());
    EXPECT_FALSE(world.Step(1.0 / 60).Failed());
    EXPECT_NEAR(world.body(flies).linear_velocity_W.x(), 1, 1e-9) << pull;
  }
}

// A brick is turned about its middle by its user, past another that stands beside it, in one step. A third one stands on one of them, or on none.
TEST(Groups, WhoIsTurnedPastAnotherHitsIt) {
  constexpr double kStep = 1.0 / 60;
  for (const BodyKind kind : {BodyKind::kDynamic, BodyKind::kFixed})
    for (const double above : {-1.0, 0.0, 1.02})
      for (const double torque : {500, 650, 700, 800, 1000, 1300}) {
        World world(Awake());
        world.Add(Floor(0.5, 0));
        BodyDefinition brick{.shape = Shape::Box({0.5, 0.25, 0.25}),
                             .mass = 1,
                             .position_W = {1.02, 0, 0.25},
                             .friction = 0.5,
                             .restitution = 0};
        const int turned = world.Add(brick);
        brick.kind = kind;
        brick.position_W.x() = 0;
        const int stands = world.Add(brick);
        if (above >= 0)
          world.Add({.shape = Shape::Box({0.1, 0.1, 0.1}),
                     .mass = 1,
                     .position_W = {above, 0, 0.6},
                     .friction = 0.5,
                     .restitution = 0});
        for (int i = 0; i < 5; ++i) testing::Step(&world, kStep);
        world.SetForce(turned, Vector3::Zero(), {0, 0, torque});
        EXPECT_FALSE(world.Step(kStep).Failed());
        bool hit = false;
        for (size_t c = 0; c < world.impulses().size(); ++c) {
          const Contact& contact = world.resolved_contacts()[c];
          hit = hit || (std::minmax(contact.body_a, contact.body_b) == std::minmax(turned, stands) &&
                        !world.impulses()[c].isZero(0));
        }
        EXPECT_TRUE(hit) << torque << ' ' << above << ' ' << (kind == BodyKind::kFixed);
      }
}

// Body 1 is a cube that lies on the floor, and may freeze.
World OneCube() {
  Settings settings;
  settings.threads = 1;
  World world(settings);
  world.Add(Floor(0.5, 0));
  world.Add(Cube({0, 0, 0.5}));
  return world;
}

// [m] by which the box of a half extent of 0.1 m that the user moves at 3 m/s is in a cube that froze in the step before it came near.
double OverlapWithWhatJustFroze(double dt) {
  const auto run = [&](int steps, double start, Body* cube) -> double {
    World world = OneCube();
    const int comes = world.Add({.shape = Shape::Box({0.1, 0.4, 0.2}),
                                 .kind = BodyKind::kKinematic,
                                 .position_W = {start, 0, 0.5},
                                 .linear_velocity_W = {3, 0, 0}});
    for (int i = 0; i < steps; ++i) testing::Step(&world, dt);
    *cube = world.body(1);
    return world.body(comes).position_W.x() + 0.1 - (cube->position_W.x() - 0.5);
  };
  Body cube;
  int freezes = 0;
  do run(++freezes, -100, &cube);
  while (!cube.frozen && freezes < 100);
  const double overlap = run(freezes + 1, -0.62 - 3 * freezes * dt, &cube);
  EXPECT_FALSE(cube.frozen);
  return overlap;
}

TEST(Groups, WhatJustFrozeIsMetByAWallThatComes) {
  for (const double dt : {1.0 / 60, 1.0 / 120}) EXPECT_LT(OverlapWithWhatJustFroze(dt), 1e-4) << dt;
}

// After one step in which the user turns a plane up under a body at rest, without gravity. Its face passes through the origin, about which it turns.
Body OnTurningPlane(bool slab, BodyDefinition body, double dt) {
  const double thin = 0.01;  // half of the slab: its middle goes around the origin
  Settings settings = Awake();
  settings.gravity.setZero();
  World world(settings);
  BodyDefinition plane{.shape = Shape::HalfSpace(), .kind = BodyKind::kKinematic, .friction = 0, .restitution = 0};
  plane.angular_velocity_W = {0, -1, 0};
  if (slab) {
    plane.shape = Shape::Box({20, 20, thin});
    plane.position_W = {0, 0, -thin};
    plane.linear_velocity_W = {thin, 0, 0};
  }
  world.Add(plane);
  body.friction = 0, body.restitution = 0;
  const int number = world.Add(body);
  const StepReport report = world.Step(dt);
  EXPECT_FALSE(report.Failed());
  EXPECT_EQ(report.gave_up, 0);
  EXPECT_EQ(report.overlapping, 0);
  return world.body(number);
}

// A half-space has no size, but its turn moves what is far out as that of a slab does.
TEST(Groups, AHalfSpaceThatTurnsHitsAsASlabDoes) {
  const BodyDefinition ball{.shape = Shape::Sphere(0.1), .mass = 1, .position_W = {2, 0, 0.12}},
      beam{.shape = Shape::Box({5, 0.1, 0.1}), .mass = 1, .position_W = {0, 0, 0.2}};
  for (const double dt : {1.0 / 30, 1.0 / 60})
    for (const BodyDefinition& body : {ball, beam}) {
      const Body plane = OnTurningPlane(false, body, dt), slab = OnTurningPlane(true, body, dt);
      EXPECT_NEAR((plane.linear_velocity_W - slab.linear_velocity_W).norm(), 0, 0.02) << dt;
      EXPECT_NEAR((plane.angular_velocity_W - slab.angular_velocity_W).norm(), 0, 0.02) << dt;
    }
  EXPECT_NEAR(OnTurningPlane(false, ball, 1.0 / 60).linear_velocity_W.z(), 2, 0.02);
}

// A row of cubes that is a crowd, and one more 0.5 m cube before its end, at that distance. Returns its velocity after one step, in which the
// last of the row is pulled towards it, or the first is pushed by a wall.
double BeyondARow(double distance, double acceleration, double push, bool freeze) {
  Settings settings = freeze ? Settings{} : Awake();
  settings.threads = 1;
  World world(settings);
  world.Add(Floor(0.2, 0));
  BodyDefinition cube = Cube(Vector3::Zero(), 0.2);
  cube.shape = Shape::Box({0.25, 0.25, 0.25});
  const int count = 24;
  int last = 0;
  for (int k = 0; k < count; ++k) {
    cube.position_W = {0.5 * k, 0, 0.25};
    last = world.Add(cube);
  }
  cube.position_W.x() += 0.5 + distance;
  const int beyond = world.Add(cube);
  for (int i = 0; freeze && i < 100 && !world.body(last).frozen; ++i) testing::Step(&world, 1.0 / 60);
  EXPECT_EQ(world.body(last).frozen, freeze);
  if (acceleration > 0) world.SetForce(last, {acceleration, 0, 0}, Vector3::Zero());
  if (push > 0)
    world.Add({.shape = Shape::Box({0.25, 0.25, 0.25}),
               .kind = BodyKind::kKinematic,
               .position_W = {-0.51, 0, 0.25},
               .linear_velocity_W = {push, 0, 0},
               .friction = 0});
  const StepReport report = world.Step(1.0 / 60);
  EXPECT_FALSE(report.Failed());
  EXPECT_LT(world.body(last).position_W.x() + 0.5, world.body(beyond).position_W.x() + 1e-3);
  return world.body(beyond).linear_velocity_W.x();
}

// Whom a crowd may reach in a step belongs to it: by the user's forces, on what is frozen, too, and by walls that push.
TEST(Groups, ACrowdReachesAsFarAsItIsPulledAndPushed) {
  EXPECT_GT(BeyondARow(0.1, 1080, 0, true), 1);
  EXPECT_GT(BeyondARow(0.1, 1080, 0, false), 1);
  EXPECT_GT(BeyondARow(0.02, 0, 6, false), 1);
}

// Which of two bodies alike has the lower number does not decide whether they race.
TEST(Groups, WhoRacesGoesByNoNumber) {
  const auto pieces = [](bool first) {
    World world(Awake());
    world.Add(Floor(0.5, 0));
    BodyDefinition spins = Cube({-1.5, 0, 0.5});
    spins.angular_velocity_W = {0, 0, 30};
    if (first) world.Add(spins);
    for (int k = 0; k < 22; ++k) world.Add(Cube({1.0 * k, 0, 0.5}));
    if (!first) world.Add(spins);
    return world.Step(1.0 / 60).pieces;
  };
  EXPECT_EQ(pieces(true), pieces(false));
}

// A rod of 100 kg pushes two columns of balls, one at each end, by its spin alone: it carries the shorter one into a ball that lies beyond.
TEST(Groups, ACrowdReachesAsFarAsItIsTurned) {
  Settings settings = Awake();
  settings.gravity.setZero();
  World world(settings);
  world.Add({.shape = Shape::Box({0.5, 0.1, 0.1}), .mass = 100, .angular_velocity_W = {0, 0, 10}, .friction = 0});
  for (int k = 0; k < 24; ++k)
    world.Add({.shape = Shape::Sphere(0.1), .mass = 0.1, .position_W = {-0.3, -0.2 - 0.2 * k, 0}, .friction = 0});
  world.Add({.shape = Shape::Sphere(0.1), .mass = 0.1, .position_W = {0.45, 0.2, 0}, .friction = 0});
  const int beyond =
      world.Add({.shape = Shape::Sphere(0.1), .mass = 0.1, .position_W = {0.45, 0.46, 0}, .friction = 0});
  EXPECT_FALSE(world.Step(1.0 / 30).Failed());
  EXPECT_GT(world.body(beyond).linear_velocity_W.y(), 1);
  EXPECT_GT((world.body(beyond).position_W - world.body(beyond - 1).position_W).norm(), 0.2 - 1e-4);
}

// A fan that nobody meets is nothing to a crowd, however fast and far away it turns.
TEST(Groups, WhatTurnsFarAwayIsNothingToACrowd) {
  const auto heap = [](bool fan) {
    World world(testing::AsCrowd(OneThread()));
    world.Add(Floor());
    for (int k = 0; k < 6; ++k) {
      BodyDefinition cube = Cube({0.1 * k, 0.07 * k, 1 + 1.6 * k});
      cube.rotation_WB = testing::Turn(0.3 * k, {1, 2, 3});
      world.Add(cube);
    }
    if (fan)
      world.Add({.shape = Shape::Box({1, 0.05, 0.05}),
                 .kind = BodyKind::kKinematic,
                 .position_W = {100, 0, 5},
                 .angular_velocity_W = {0, 0, 314}});
    std::vector<Vector3> places;
    for (int i = 0; i < 90; ++i) {
      world.Step(1.0 / 60);
      for (int k = 1; k < 7; ++k) places.push_back(world.body(k).position_W);
    }
    return places;
  };
  EXPECT_EQ(heap(false), heap(true));
}

// What rests costs nothing, whatever is set far away from it before each step.
TEST(Groups, WhatIsSetFarAwayWakesNobody) {
  World world = OneCube();
  const int far = world.Add({.shape = Shape::Sphere(0.1), .kind = BodyKind::kKinematic, .position_W = {100, 0, 5}});
  for (int i = 0; i < 120; ++i) {
    world.MoveTo(far, {100 + std::sin(0.1 * i), 0, 5}, Quaternion::Identity(), 1.0 / 60);
    world.SetForce(far, {0, 0, 1.0 * i}, Vector3::Zero());
    const StepReport report = world.Step(1.0 / 60);
    if (i < 60) continue;
    EXPECT_TRUE(world.body(1).frozen) << i;
    EXPECT_EQ(report.pieces, 0) << i;
  }
}

// What rests beside a blade that turns and never touches it is frozen, and stays so.
TEST(Groups, WhatTurnsNearbyWakesNobody) {
  World world = OneCube();
  world.Add({.shape = Shape::Box({1, 0.05, 0.05}),
             .kind = BodyKind::kKinematic,
             .position_W = {0, 1.8, 0.5},
             .angular_velocity_W = {0, 0, 30}});
  for (int i = 0; i < 120; ++i) {
    const StepReport report = testing::Step(&world, 1.0 / 60);
    if (i < 60) continue;
    EXPECT_TRUE(world.body(1).frozen) << i;
    EXPECT_EQ(report.woken + report.newly_frozen, 0) << i;
  }
}

}  // namespace
}  // namespace islet
