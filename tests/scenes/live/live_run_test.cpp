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

TEST(LiveRun, WhatCannotBeDraggedIsRefused) {
  LiveRun run = CubeOnAFloor();
  EXPECT_THROW(run.Do(Drag(0, {0, 0, 0}, {0, 0, 1})), std::invalid_argument);
  EXPECT_THROW(run.Do(Drag(99, {0, 0, 0}, {0, 0, 1})), std::invalid_argument);
}

}  // namespace
}  // namespace islet
