// A run that somebody plays with: what each command does to the world.
#include "scenes/live/live_run.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Cube;
using testing::Floor;

LiveRun CubeOnAFloor() {
  World world;
  world.Add(Floor());
  world.Add(Cube({0, 0, 0.5}));
  return {std::move(world), 1.0 / 60};
}

LiveCommand Drag(int body, const Vector3& at_B, const Vector3& to_W) {
  LiveCommand command;
  command.kind = LiveCommand::Kind::kDrag;
  command.body = body;
  command.from = at_B;
  command.vector = to_W;
  return command;
}
LiveCommand Plain(LiveCommand::Kind kind) {
  LiveCommand command;
  command.kind = kind;
  return command;
}

TEST(LiveRun, TellsWhetherSomebodyChangedIt) {
  using Kind = LiveCommand::Kind;
  for (const Kind kind : {Kind::kRun, Kind::kPause, Kind::kStep, Kind::kRelease}) {
    LiveRun run = CubeOnAFloor();
    run.Do(Plain(kind));
    run.Advance();
    EXPECT_FALSE(run.changed());
  }
  for (const Kind kind : {Kind::kGravity, Kind::kFriction, Kind::kThrow, Kind::kDrag}) {
    LiveRun run = CubeOnAFloor();
    LiveCommand command = Plain(kind);
    command.from = {0, 0, 20};
    command.body = 1;
    run.Do(command);
    EXPECT_TRUE(run.changed());
  }
  LiveRun run = CubeOnAFloor();
  EXPECT_THROW(run.Do(Drag(7, {0, 0, 0}, {0, 0, 0})), std::invalid_argument);
  EXPECT_FALSE(run.changed());
}

TEST(LiveRun, BeginsAtRestAndStepsOnRequest) {
  LiveRun run = CubeOnAFloor();
  EXPECT_FALSE(run.Advance());
  run.Do(Plain(LiveCommand::Kind::kStep));
  EXPECT_TRUE(run.Advance());
  EXPECT_FALSE(run.Advance());
  EXPECT_EQ(run.steps(), 1);
  run.Do(Plain(LiveCommand::Kind::kRun));
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(run.Advance());
  run.Do(Plain(LiveCommand::Kind::kPause));
  EXPECT_FALSE(run.Advance());
  EXPECT_EQ(run.steps(), 6);
}

// By a corner, through the air: it hangs there, still, and falls when it is let go. Every step is clean.
TEST(LiveRun, ABodyIsDraggedByAPoint) {
  LiveRun run = CubeOnAFloor();
  run.Do(Plain(LiveCommand::Kind::kRun));
  for (int i = 0; i < 30; ++i) run.Advance();
  const Vector3 corner(0.5, 0.5, 0.5), goal(2, 1, 4);
  for (int i = 0; i < 240; ++i) {
    run.Do(Drag(1, corner, goal));
    run.Advance();
    EXPECT_FALSE(run.report().Failed()) << i;
  }
  const Body& cube = run.world().body(1);
  EXPECT_NEAR((cube.position_W + cube.rotation_WB * corner - goal).norm(), 0, 0.05);
  EXPECT_LT(cube.linear_velocity_W.norm(), 1);
  run.Do(Plain(LiveCommand::Kind::kRelease));
  for (int i = 0; i < 240; ++i) run.Advance();
  EXPECT_LT(run.world().body(1).position_W.z(), 0.9);
  EXPECT_EQ(run.world().body(1).force_W, Vector3::Zero());
}

// Where it is pulled so close to its middle that the square of its turning vanishes.
TEST(LiveRun, ABodyIsDraggedByAlmostItsMiddle) {
  World world;
  world.Add({.shape = Shape::Box({0.3, 0.4, 0.5}), .position_W = {0, 0, 1.5}});
  LiveRun run(std::move(world), 1.0 / 60);
  run.Do(Plain(LiveCommand::Kind::kRun));
  for (int i = 0; i < 3; ++i) {
    run.Do(Drag(0, {-1e-300, -1e-300, 0}, {-1.5, 0.1, 10}));
    run.Advance();
  }
  EXPECT_GT(run.world().body(0).position_W.z(), 1.6);
  EXPECT_TRUE(run.world().body(0).rotation_WB.coeffs().allFinite());
}

TEST(LiveRun, ABallIsThrown) {
  LiveRun run = CubeOnAFloor();
  LiveCommand ball = Plain(LiveCommand::Kind::kThrow);
  ball.from = {-3, 0, 0.6};
  ball.vector = {8, 0, 0};
  ball.radius = 0.3;
  ball.density = 10;
  run.Do(ball);
  EXPECT_EQ(run.generation(), 1);
  run.Do(Plain(LiveCommand::Kind::kRun));
  for (int i = 0; i < 60; ++i) run.Advance();
  EXPECT_GT(run.world().body(1).position_W.x(), 0.2);
  ball.from = run.world().body(1).position_W;  // where the cube is
  EXPECT_THROW(run.Do(ball), std::invalid_argument);
  EXPECT_EQ(run.generation(), 1);
}

TEST(LiveRun, GravityAndFrictionChange) {
  LiveRun run = CubeOnAFloor();
  run.Do(Plain(LiveCommand::Kind::kRun));
  for (int i = 0; i < 30; ++i) run.Advance();
  LiveCommand gravity = Plain(LiveCommand::Kind::kGravity);
  gravity.vector = {3, 0, -9.81};  // below the angle of friction
  run.Do(gravity);
  for (int i = 0; i < 60; ++i) run.Advance();
  EXPECT_NEAR(run.world().body(1).position_W.x(), 0, 1e-4);
  LiveCommand friction = Plain(LiveCommand::Kind::kFriction);
  friction.value = 0;
  run.Do(friction);
  for (int i = 0; i < 60; ++i) run.Advance();
  EXPECT_NEAR(run.world().body(1).position_W.x(), 1.5, 2e-2);
}

// A fan that blows, and a gravity of its own: both are the scene's.
TEST(LiveRun, TheSceneDrivesItsWorldUnlessItIsAskedForOtherwise) {
  LiveRun::Drive drive = [](double time, World* world) {
    world->SetGravity({0, 0, time < 0.5 ? -9.81 : -5});
    world->SetForce(1, {0, 0, 20}, Vector3::Zero());
  };
  World world;
  world.Add(Floor());
  world.Add(Cube({0, 0, 0.5}));
  LiveRun run(std::move(world), 1.0 / 60, drive);
  run.Do(Plain(LiveCommand::Kind::kRun));
  for (int i = 0; i < 60; ++i) run.Advance();
  EXPECT_EQ(run.world().settings().gravity, Vector3(0, 0, -5));
  EXPECT_GT(run.world().body(1).position_W.z(), 2);
  LiveCommand gravity = Plain(LiveCommand::Kind::kGravity);
  gravity.vector = {0, 0, -40};
  run.Do(gravity);
  run.Advance();
  EXPECT_EQ(run.world().settings().gravity, Vector3(0, 0, -40));
  for (int i = 0; i < 150; ++i) run.Advance();
  EXPECT_NEAR(run.world().body(1).position_W.z(), 0.5, 0.01);
  for (int i = 0; i < 60; ++i) {  // it is dragged against the fan
    run.Do(Drag(1, {0, 0, 0}, {0, 0, 1}));
    run.Advance();
  }
  EXPECT_NEAR(run.world().body(1).position_W.z(), 1, 0.05);
}

TEST(LiveRun, WhatIsLetGoFeelsItsForceAgain) {
  World world;
  world.Add(Floor());
  const int cube = world.Add(Cube({0, 0, 0.5}));
  world.SetForce(cube, {0, 0, 12}, {0, 0, 1});
  LiveRun run(std::move(world), 1.0 / 60);
  run.Do(Plain(LiveCommand::Kind::kRun));
  for (int i = 0; i < 10; ++i) {
    run.Do(Drag(cube, {0, 0, 0.1 * i}, {0, 0, 2}));
    run.Advance();
  }
  EXPECT_NE(run.world().body(cube).force_W, Vector3(0, 0, 12));
  run.Do(Plain(LiveCommand::Kind::kRelease));
  EXPECT_EQ(run.world().body(cube).force_W, Vector3(0, 0, 12));
  EXPECT_EQ(run.world().body(cube).torque_W, Vector3(0, 0, 1));
}

TEST(LiveRun, FrictionIsThatOfBallsToCome) {
  LiveRun run = CubeOnAFloor();
  EXPECT_FALSE(run.friction());
  LiveCommand friction = Plain(LiveCommand::Kind::kFriction);
  friction.value = 0.125;
  run.Do(friction);
  EXPECT_EQ(run.friction(), 0.125);
  LiveCommand ball = Plain(LiveCommand::Kind::kThrow);
  ball.from = {-3, 0, 0.6};
  run.Do(ball);
  ball.from = {-5, 0, 0.6};
  run.Do(ball);
  EXPECT_EQ(run.world().body(3).friction, 0.125);
  EXPECT_EQ(&run.world().shape(2).data(), &run.world().shape(3).data());
}

TEST(LiveRun, WhatCannotBeDraggedIsRefused) {
  LiveRun run = CubeOnAFloor();
  EXPECT_THROW(run.Do(Drag(0, {0, 0, 0}, {0, 0, 1})), std::invalid_argument);
  EXPECT_THROW(run.Do(Drag(99, {0, 0, 0}, {0, 0, 1})), std::invalid_argument);
}

}  // namespace
}  // namespace islet
