// What rides on walls and belts whose velocity the user changes: it goes along as far as friction and weight allow, and no farther.
#include <cmath>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::kGravity;

constexpr double kMu = 0.4;

BodyDefinition Plate(double restitution = 0) {
  return {.shape = Shape::Box({3, 1, 0.05}),
          .kind = BodyKind::kKinematic,
          .position_W = {0, 0, -0.05},
          .friction = kMu,
          .restitution = restitution};
}

BodyDefinition Crate(double z, double restitution = 0) {
  return {.shape = Shape::Box({0.1, 0.1, 0.1}),
          .mass = 1,
          .position_W = {0, 0, z},
          .friction = kMu,
          .restitution = restitution};
}

// In steps of changing length all that bodies in a crowd get is told, also where they keep the velocities that carrying left.
TEST(Ride, ShortStepsAfterLongOnesExplainTheirMomentum) {
  World world(testing::AsCrowd(Awake()));
  world.Add(
      {.shape = Shape::Box({20, 1, 0.1}), .kind = BodyKind::kKinematic, .position_W = {0, 0, -0.1}, .friction = 0.5});
  for (int k = 0; k < 3; ++k)
    world.Add({.shape = Shape::Box({0.2, 0.2, 0.2}), .mass = 1, .position_W = {0, 0, 0.2 + 0.4 * k}, .friction = 0.5});
  double t = 0;
  for (int frame = 0; frame < 40; ++frame) {
    const double dt = frame % 4 == 0 ? 1.0 / 240 : 1.0 / 30;
    t += dt;
    world.MoveTo(0, {0.5 * t * t, 0, -0.1 - 0.5 * t * t}, Quaternion::Identity(), dt);
    EXPECT_FALSE(world.Step(dt).Failed()) << frame;
  }
}

// A post beside a crate tips over as their plate speeds up, and rides no more. The crate does.
TEST(Ride, WhatTipsTakesItFromNobodyElse) {
  for (const double rate : {30.0, 60.0, 240.0}) {
    for (const bool crowd : {false, true}) {
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      world.Add(Plate());
      world.Add(Crate(0.1));
      BodyDefinition post = Crate(0.2);
      post.shape = Shape::Box({0.02, 0.1, 0.2});
      post.position_W.y() = 0.2004;
      world.Add(post);
      const double dt = 1 / rate;
      testing::StepTimes(&world, 3, dt);
      for (int frame = 0; frame < 0.3 * rate; ++frame) {
        world.SetVelocity(0, {0.6 * kMu * kGravity * (frame + 0.5) * dt, 0, 0}, Vector3::Zero());
        testing::Step(&world, dt);
        EXPECT_NEAR((world.body(1).position_W - world.body(0).position_W).x(), 0, 1e-6) << rate << crowd << frame;
      }
      EXPECT_GT(world.body(2).angular_velocity_W.norm(), 0.5) << rate << crowd;
    }
  }
}

// Beside a crate balls fall on a post and on their plate, which speeds up: blows cut the step in pieces, and what rides keeps its place in all of
// them. When it had to catch up in the first, it slipped by 17 mm in 0.6 s. What is told of it is in its cone, and all that it got.
TEST(Ride, KeepsItsPlaceWhateverGoesOnBesideIt) {
  constexpr double kShare = 0.8;
  for (const double rate : {30.0, 60.0, 240.0}) {
    World world(Awake());
    world.Add(Plate(0.7));
    world.Add(Crate(0.1));
    BodyDefinition post = Crate(0.3, 0.2);
    post.shape = Shape::Box({0.02, 0.1, 0.3});
    post.position_W.y() = 0.2005;
    world.Add(post);
    for (int k = 0; k < 3; ++k)
      world.Add({.shape = Shape::Sphere(0.03),
                 .mass = 0.05,
                 .position_W = {0, 0.1 * k - 0.05, 0.45 + 0.2 * k},
                 .friction = kMu,
                 .restitution = 0.7});
    const double dt = 1 / rate;
    testing::StepTimes(&world, 3, dt);
    int pieces = 0, told = 0;
    for (int frame = 0; frame < 0.6 * rate; ++frame) {
      const Vector3 before = world.body(1).linear_velocity_W;
      world.SetVelocity(0, {kShare * kMu * kGravity * (frame + 0.5) * dt, 0, 0}, Vector3::Zero());
      pieces += testing::Step(&world, dt).pieces;
      EXPECT_NEAR((world.body(1).position_W - world.body(0).position_W).x(), 0, 1e-6) << rate << ' ' << frame;
      Vector3 sum = Vector3::Zero();
      for (size_t c = 0; c < world.impulses().size(); ++c) {
        const Contact& contact = world.resolved_contacts()[c];
        if (contact.body_a != 1 && contact.body_b != 1) continue;
        const Vector3& impulse = world.impulses()[c];
        const double press = contact.normal_W.dot(impulse), floor = 1e-6 * kGravity * dt;
        EXPECT_GT(press, -floor) << rate << ' ' << frame;
        EXPECT_LT((impulse - press * contact.normal_W).norm(), contact.friction * press + floor)
            << rate << ' ' << frame;
        sum += (contact.body_b == 1 ? 1 : -1) * impulse;
        ++told;
      }
      EXPECT_LT((world.body(1).linear_velocity_W - before - sum + Vector3(0, 0, kGravity * dt)).norm(), 1e-12) << frame;
    }
    EXPECT_GT(pieces, rate) << "the step was one piece";
    EXPECT_GT(told, 0);
  }
}

// A turntable speeds up, and a deck tilts under a ball that rolls down: all that bodies get is told, and the error is of second order.
TEST(Ride, TurnsWithItsWalls) {
  const auto ends = [](bool tilts, double dt) {
    World world(Awake());
    BodyDefinition deck = Plate();
    deck.friction = 0.9;
    world.Add(deck);
    BodyDefinition crate = Crate(0.1);
    crate.position_W.x() = 0.5;
    crate.friction = 0.9;
    const int rider = world.Add(tilts ? testing::Ball({0, 0.5, 0.1}, 0.1, 0.9, 0) : crate);
    const double mass = world.body(rider).mass;
    testing::StepTimes(&world, 3, dt);
    for (int frame = 0; frame < 1.5 / dt - 0.5; ++frame) {
      const auto angle = [](double t) { return 0.06 * (1.5 * t - std::sin(1.5 * t)); };
      const double t = (frame + 1) * dt;
      const Quaternion turn = testing::Turn(angle(t), tilts ? Vector3::UnitX() : Vector3::UnitZ());
      const Vector3 before = world.body(rider).linear_velocity_W;
      world.MoveTo(0, turn * Vector3(0, 0, -0.05), turn, dt);
      testing::Step(&world, dt);
      Vector3 sum = -mass * kGravity * dt * Vector3::UnitZ();
      for (const Vector3& impulse : world.impulses()) sum += impulse;
      EXPECT_LT((mass * (world.body(rider).linear_velocity_W - before) - sum).norm(), 1e-12 * mass) << t;
    }
    const Body& at = world.body(0);
    return (at.rotation_WB.conjugate() * (world.body(rider).position_W - at.position_W)).eval();
  };
  EXPECT_LT((ends(false, 1.0 / 60) - Vector3(0.5, 0, 0.15)).norm(), 1e-6);
  const Vector3 right = ends(true, 1.0 / 1920), at_60 = ends(true, 1.0 / 60), at_240 = ends(true, 1.0 / 240);
  EXPECT_GT((at_60 - right).norm(), 1e-6);
  EXPECT_LT((at_240 - right).norm(), (at_60 - right).norm() / 12);
}

// Two bodies of a crowd that pass each other far away make the world step in halves. What rides does not feel it.
TEST(Ride, KeepsItsPlaceInHalves) {
  Settings settings = Awake();
  settings.group_bodies = 1;
  World world(settings);
  world.Add(Plate());
  world.Add(Crate(0.1));
  world.Add(Crate(0.3));
  testing::AddPassersBy(&world);
  const double dt = 1.0 / 60;
  testing::StepTimes(&world, 3, dt);
  for (int frame = 0; frame < 20; ++frame) {
    world.SetVelocity(0, {0.8 * kMu * kGravity * (frame + 0.5) * dt, 0, 0}, Vector3::Zero());
    testing::Step(&world, dt);
    for (const int i : {1, 2}) EXPECT_NEAR((world.body(i).position_W - world.body(0).position_W).x(), 0, 1e-6) << frame;
  }
}

// A plate that speeds up by `share` of what friction can give, or slows down on its way up by that of gravity: crates on it and on each
// other do not move against it. At half of that they once began to slip, and to hop, by a first order of the step.
TEST(Ride, KeepsItsPlaceUpToTheLimit) {
  for (const double rate : {30.0, 60.0, 240.0}) {
    for (const bool crowd : {false, true}) {
      for (const double share : {0.3, 0.6, 0.99}) {
        for (const bool up : {false, true}) {
          World world(crowd ? testing::AsCrowd(Awake()) : Awake());
          world.Add(Plate());
          world.Add(Crate(0.1));
          world.Add(Crate(0.3));
          const double dt = 1 / rate, acceleration = (up ? -1 : kMu) * share * kGravity, start = up ? 5 : 0;
          world.SetVelocity(0, up ? Vector3(0, 0, start) : Vector3::Zero(), Vector3::Zero());
          if (up) {  // the start is a blow; what it leaves is over before the plate slows down
            for (const int i : {1, 2}) world.SetVelocity(i, {0, 0, start}, Vector3::Zero());
            testing::StepTimes(&world, 3, dt);
          }
          const double height = world.body(1).position_W.z() - world.body(0).position_W.z();
          for (int frame = 0; frame < 0.5 * rate; ++frame) {
            const double speed = start + acceleration * (frame + 0.5) * dt;
            world.SetVelocity(0, up ? Vector3(0, 0, speed) : Vector3(speed, 0, 0), Vector3::Zero());
            testing::Step(&world, dt);
            for (const int i : {1, 2}) {
              const Vector3 place = world.body(i).position_W - world.body(0).position_W;
              EXPECT_NEAR(place.x(), 0, 1e-7) << rate << crowd << share << up;
              EXPECT_NEAR(place.z(), height + 0.2 * (i - 1), 1e-6) << rate << crowd << share << up;
            }
          }
        }
      }
    }
  }
}

// A slope of 0.5 rad on which friction of 0.4 holds nothing at rest speeds up downhill by half of what gravity pulls: that asks for 0.27 of friction,
// and a crate stays after its first step. (As it had slid by less than the slope's change in a step, it rode in no later one, and drifted for ever.)
TEST(Ride, HoldsWhereItsWallRelievesFriction) {
  const Quaternion tilt = testing::Turn(0.5, Vector3::UnitY());
  const Vector3 down = tilt * Vector3::UnitX();
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    SCOPED_TRACE(dt);
    World world(Awake());
    BodyDefinition plate = Plate();
    plate.position_W = tilt * Vector3(0, 0, -0.05);
    plate.rotation_WB = tilt;
    world.Add(plate);
    BodyDefinition crate = Crate(0);
    crate.position_W = tilt * Vector3(0, 0, 0.1);
    crate.rotation_WB = tilt;
    world.Add(crate);
    const double acceleration = 0.5 * kGravity * std::sin(0.5);
    double after_start = 0;
    for (int frame = 0; frame < 1 / dt; ++frame) {
      world.SetVelocity(0, acceleration * (frame + 0.5) * dt * down, Vector3::Zero());
      testing::Step(&world, dt);
      const double place = down.dot(world.body(1).position_W - world.body(0).position_W);
      if (frame <= 5) after_start = place;
      EXPECT_NEAR(place, after_start, 1e-5) << frame;
    }
  }
}

// A plate speeds up by twice what friction gives, and the user's force pulls the crate on it along, all or most of the way: what friction is asked
// for then holds. (What rode was known by the last press alone: the crate slid back by 17 mm a second at 1/60 s.)
TEST(Ride, HoldsWhatTheUserPullsAlong) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240})
    for (const bool crowd : {false, true})
      for (const double share : {0.7, 1.0}) {
        SCOPED_TRACE(::testing::Message() << dt << crowd << share);
        World world(crowd ? testing::AsCrowd(Awake()) : Awake());
        world.Add(Plate());
        world.Add(Crate(0.1));
        testing::StepTimes(&world, 3, dt);
        const double acceleration = 2 * kMu * kGravity;
        for (int frame = 0; frame < 0.5 / dt; ++frame) {
          const double now = acceleration * std::min(1.0, 5 * frame * dt), speed = world.body(0).linear_velocity_W.x();
          world.SetForce(1, {share * now * world.body(1).mass, 0, 0}, Vector3::Zero());
          world.SetVelocity(0, {speed + now * dt, 0, 0}, Vector3::Zero());
          testing::Step(&world, dt);
          EXPECT_NEAR((world.body(1).position_W - world.body(0).position_W).x(), 0, 1e-6) << frame;
        }
      }
}

// A crate beside the middle of a swing's seat: weight follows the seat, and friction is asked for a fifth of what it can give. (As it was given no
// more than what held it before, it slid by 6 mm in the first swing at 1/60 s.)
TEST(Ride, HoldsOnASwing) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    SCOPED_TRACE(dt);
    World world(Awake());
    const double length = 2, rate = std::sqrt(kGravity / length);
    const auto lean = [&](double time) { return 0.5 * std::sin(rate * time); };
    const auto seat = [&](double time) {
      return Vector3(-length * std::sin(lean(time)), 0, length * (1 - std::cos(lean(time))));
    };
    const auto turn = [&](double time) { return testing::Turn(lean(time), Vector3::UnitY()); };
    BodyDefinition plate = Plate(), crate = Crate(0.1);
    plate.friction = crate.friction = 0.6;
    crate.position_W.x() = 1;
    plate.angular_velocity_W = crate.angular_velocity_W = 0.5 * rate * Vector3::UnitY();
    plate.linear_velocity_W =
        -0.5 * rate * length * Vector3::UnitX() + plate.angular_velocity_W.cross(plate.position_W);
    crate.linear_velocity_W =
        -0.5 * rate * length * Vector3::UnitX() + crate.angular_velocity_W.cross(crate.position_W);
    world.Add(plate);
    world.Add(crate);
    for (int frame = 1; frame <= 3 / dt; ++frame) {
      const double time = frame * dt;
      world.MoveTo(0, seat(time) + turn(time) * plate.position_W, turn(time), dt);
      testing::Step(&world, dt);
      const Vector3 place = turn(time).conjugate() * (world.body(1).position_W - seat(time));
      EXPECT_NEAR(place.x(), 1, 1e-4) << frame;
    }
  }
}

// A slender body on a truck that speeds up stands as long as its weight holds it against its inertia, and tips then as by a force of mass times
// acceleration, later by half a step at most. (All of a step's change at its foot where it is already at its edge was a kick: a can fell from 0.9
// of the limit on, and what tips was ahead by half a step, three times as far at 1/60 s.)
TEST(Ride, TipsAsByAForce) {
  const double half = 0.1, height = 0.3;
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240})
    for (const bool can : {false, true})
      for (const double share : {0.9, 0.98, 1.02}) {
        SCOPED_TRACE(::testing::Message() << dt << can << share);
        const double acceleration = share * kGravity * half / height;
        const auto tilt_after = [&](double time, bool by_force) {
          World world(Awake());
          world.Add({.shape = Shape::Box({50, 2, 0.1}),
                     .kind = BodyKind::kKinematic,
                     .position_W = {0, 0, -0.1},
                     .friction = 2,
                     .restitution = 0});
          const int body = world.Add({.shape = can ? Shape::Cylinder(half, height) : Shape::Box({half, 0.2, height}),
                                      .mass = 1,
                                      .position_W = {0, 0, height},
                                      .friction = 2,
                                      .restitution = 0});
          testing::StepTimes(&world, 5, dt);
          if (by_force) world.SetForce(body, {-acceleration, 0, 0}, Vector3::Zero());
          for (int frame = 0; frame < std::lround(time / dt); ++frame) {
            if (!by_force) world.SetVelocity(0, {acceleration * (frame + 0.5) * dt, 0, 0}, Vector3::Zero());
            testing::Step(&world, dt);
          }
          return (world.body(body).rotation_WB * Vector3::UnitZ()).head<2>().norm();
        };
        if (share < 1) {
          EXPECT_LT(tilt_after(1.5, false), 1e-5);
        } else if (!can) {
          const double time = 0.6;
          EXPECT_LT(tilt_after(time, false), 1.01 * tilt_after(time, true));
          EXPECT_GT(tilt_after(time, false), tilt_after(time - dt, true));
        }
      }
}

// A cart pushes a crate before it by up to three times gravity, with a second one before that: friction on its front holds both. Who starts at
// once is at full force after one step, which is of second order.
TEST(Ride, HoldsWhatItPushes) {
  for (const bool crowd : {false, true}) {
    for (const bool smoothly : {false, true}) {
      for (const double rate : {30.0, 120.0}) {
        World world(crowd ? testing::AsCrowd(Awake()) : Awake());
        BodyDefinition front = Plate();
        front.shape = Shape::Box({0.1, 0.5, 0.5});
        front.position_W = {-0.2, 0, 0};
        front.friction = 1;
        world.Add(front);
        BodyDefinition crate = Crate(0);
        crate.friction = 1;
        world.Add(crate);
        crate.position_W.x() = 0.2;
        world.Add(crate);
        const double dt = 1 / rate;
        if (smoothly) {  // they are pressed to it before
          world.SetForce(2, {-200, 0, 0}, Vector3::Zero());
          testing::StepTimes(&world, 3, dt);
        }
        for (int frame = 0; frame < 0.5 * rate; ++frame) {
          world.SetForce(2, Vector3::Zero(), Vector3::Zero());
          world.SetVelocity(0, {3 * kGravity * (frame + 0.5) * dt, 0, 0}, Vector3::Zero());
          testing::Step(&world, dt);
        }
        const double most = (smoothly ? 0.3 : 8) * dt * dt;
        for (const int i : {1, 2}) {
          EXPECT_LT((world.body(i).position_W - world.body(0).position_W - Vector3(0.2 * i, 0, 0)).norm(), most)
              << crowd << smoothly << rate << ' ' << i;
        }
      }
    }
  }
}

// A bar slides over a crate that rides, its other end on a ledge. What solves leave of slip where the crate sticks is no slide: it lost its ride in
// single steps, and slipped by 2.7 mm.
TEST(Ride, KeepsItsPlaceUnderWhatSlides) {
  World world(Awake());
  BodyDefinition tray = Plate();
  tray.friction = 0.5;
  world.Add(tray);
  BodyDefinition ledge = Plate();
  ledge.shape = Shape::Box({3, 0.05, 0.05});
  ledge.kind = BodyKind::kFixed;
  ledge.position_W = {0, 0.6, 0.15};
  ledge.friction = 0.01;
  world.Add(ledge);
  BodyDefinition crate = Crate(0.1), bar = Crate(0.22);
  crate.shape = Shape::Box({0.2, 0.2, 0.1});
  crate.mass = 5;
  bar.shape = Shape::Box({0.05, 0.4, 0.02});
  bar.mass = 0.2;
  bar.position_W.y() = 0.3;
  crate.friction = bar.friction = 0.5;
  world.Add(crate);
  world.Add(bar);
  const double dt = 1.0 / 60;
  testing::StepTimes(&world, 5, dt);
  for (int frame = 1; frame <= 30; ++frame) {
    world.SetVelocity(0, {0.45 * kGravity * frame * dt, 0, 0}, Vector3::Zero());
    testing::Step(&world, dt);
    EXPECT_NEAR((world.body(2).position_W - world.body(0).position_W).x(), 0, 1e-6) << frame;
    EXPECT_NEAR((world.body(2).linear_velocity_W - world.body(0).linear_velocity_W).x(), 0, 1e-5) << frame;
  }
  EXPECT_LT((world.body(3).position_W - world.body(2).position_W).x(), -0.1);
}

// A plate drops away at once from under a box that a jaw presses to a wall: the press is none of the plate's, and the box falls freely.
TEST(Ride, PressFromTheSideHoldsNobodyDown) {
  for (const bool crowd : {false, true}) {
    World world(crowd ? testing::AsCrowd(Awake()) : Awake());
    world.Add(Plate());
    BodyDefinition wall = Plate();
    wall.shape = Shape::Box({0.1, 0.5, 0.5});
    wall.kind = BodyKind::kFixed;
    wall.position_W = {0.2, 0, 0.6};
    world.Add(wall);
    BodyDefinition crate = Crate(0.1);
    crate.friction = 0;
    world.Add(crate);
    world.SetForce(2, {300, 0, 0}, Vector3::Zero());
    constexpr double kStep = 1.0 / 60;
    testing::StepTimes(&world, 3, kStep);
    const double height = world.body(2).position_W.z();
    world.SetVelocity(0, {0, 0, -4}, Vector3::Zero());
    testing::Step(&world, kStep);
    EXPECT_NEAR(world.body(2).position_W.z(), height - 0.5 * kGravity * kStep * kStep, 1e-6) << crowd;
  }
}

// A ball rolls down a deck that tilts and comes to rest again. It turns against what takes its ride back: that works, too.
TEST(Ride, CrowdsMakeNoEnergyOfIt) {
  Settings settings = Awake();
  settings.group_bodies = 0;
  for (const double rate : {30.0, 60.0, 120.0}) {
    World world(settings);
    BodyDefinition deck = Plate();
    deck.friction = 0.9;
    world.Add(deck);
    world.Add(testing::Ball({0, 0.3, 0.1}, 0.1, 0.9, 0));
    const double dt = 1 / rate;
    testing::StepTimes(&world, 1, dt);
    for (int frame = 1; frame <= rate; ++frame) {
      const Quaternion turn = testing::Turn(0.15 * (1 - std::cos(M_PI * frame * dt)), Vector3::UnitX());
      world.MoveTo(0, {0, 0, -0.05}, turn, dt);
      EXPECT_FALSE(testing::Step(&world, dt).Failed()) << rate << ' ' << frame;
    }
  }
}

// A belt that starts slowly enough carries what lies on it from the first step on; one that starts at once rubs until both are as fast.
TEST(Ride, GoesWithBeltsAsFarAsTheyRub) {
  for (const bool crowd : {false, true}) {
    for (const double start : {0.05, 2.0}) {
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      BodyDefinition belt = Plate();
      belt.kind = BodyKind::kFixed;
      world.Add(belt);
      world.Add(Crate(0.1));
      const double dt = 1.0 / 60, rubs = start / (kMu * kGravity);
      testing::StepTimes(&world, 3, dt);
      world.SetSurfaceVelocity(0, {start, 0, 0});
      testing::StepTimes(&world, 60, dt);
      const double expected = start * (1 - 0.5 * rubs);
      EXPECT_NEAR(world.body(1).position_W.x(), start > 1 ? expected : start, 1e-3 * start) << crowd;
      EXPECT_NEAR(world.body(1).linear_velocity_W.x(), start, 1e-9) << crowd;
    }
  }
}

// What is pulled away faster than weight follows is left, and falls freely; what strikes, strikes.
TEST(Ride, IsNoGlueAndNoCushion) {
  for (const bool crowd : {false, true}) {
    World falls(crowd ? testing::AsCrowd(Awake()) : Awake());
    falls.Add(Plate());
    falls.Add(Crate(0.1));
    testing::StepTimes(&falls, 3, 1.0 / 60);
    falls.SetVelocity(0, {0, 0, -10}, Vector3::Zero());
    testing::StepTimes(&falls, 12, 1.0 / 60);
    EXPECT_NEAR(falls.body(1).position_W.z(), 0.1 - 0.5 * kGravity * 0.04, 1e-9) << crowd;
    World strikes(Awake());
    strikes.Add(Plate(0.8));
    strikes.Add(Crate(0.1, 0.8));
    testing::StepTimes(&strikes, 3, 1.0 / 60);
    strikes.SetVelocity(0, {0, 0, 2}, Vector3::Zero());
    testing::Step(&strikes, 1.0 / 60);
    EXPECT_NEAR(strikes.body(1).linear_velocity_W.z() + kGravity / 60, 3.6, 1e-6);
  }
}

// A finger that the user moves and one that a force drives lift a box, if they press 1.05 times as hard as its weight and acceleration ask.
TEST(Ride, IsHeldByAsMuchAsItNeeds) {
  for (const double rate : {30.0, 240.0}) {
    World world(Awake());
    BodyDefinition finger = Plate();
    finger.shape = Shape::Box({0.05, 0.1, 0.1});
    finger.position_W = {-0.15, 0, 0};
    world.Add(finger);
    BodyDefinition driven = finger;
    driven.kind = BodyKind::kDynamic;
    driven.mass = 0.2;
    driven.position_W = {0.15, 0, 0};
    world.Add(driven);
    world.Add(Crate(0));
    const double acceleration = 5, dt = 1 / rate;
    const double grip = 1.05 * (1 + 0.2) * (kGravity + acceleration) / kMu;
    world.SetForce(1, {-grip, 0, 0}, Vector3::Zero());
    testing::StepTimes(&world, 3, dt);
    const Vector3 before = world.body(2).position_W - world.body(0).position_W;
    for (int frame = 0; frame < 0.3 * rate; ++frame) {
      world.SetVelocity(0, {0, 0, acceleration * (frame + 0.5) * dt}, Vector3::Zero());
      testing::Step(&world, dt);
    }
    EXPECT_LT((world.body(2).position_W - world.body(0).position_W - before).norm(), 1e-4) << rate;
  }
}

// A restored world goes on with the same change of velocity.
TEST(Ride, IsInSnapshots) {
  World world(Awake());
  world.Add(Plate());
  world.Add(Crate(0.1));
  const auto drive = [](World* w, int frame) {
    w->SetVelocity(0, {0.03 * frame, 0, 0}, Vector3::Zero());
    testing::Step(w, 1.0 / 60);
  };
  for (int frame = 0; frame < 5; ++frame) drive(&world, frame);
  World other(Awake());
  other.Restore(WorldSnapshot::FromBytes(world.Save().ToBytes()));
  for (World* w : {&world, &other}) drive(w, 5);
  EXPECT_EQ(world.StateHash(), other.StateHash());
}

}  // namespace
}  // namespace islet
