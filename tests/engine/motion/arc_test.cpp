// Walls that go in a circle: as exact as walls that stand, at any step.
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Awake;
using testing::kGravity;
using testing::Turn;

struct Part {
  Vector3 half, place;
};

// Moves kinematic boxes to where a tool has them that has turned about the vertical.
void TurnTool(World* world, const std::vector<Part>& parts, double angle, double dt) {
  for (size_t i = 0; i < parts.size(); ++i)
    world->MoveTo(static_cast<int>(i), Turn(angle, Vector3::UnitZ()) * parts[i].place, Turn(angle, Vector3::UnitZ()),
                  dt);
}

void AddTool(World* world, const std::vector<Part>& parts, double friction, double spin = 0) {
  for (const Part& part : parts)
    world->Add({.shape = Shape::Box(part.half),
                .kind = BodyKind::kKinematic,
                .position_W = part.place,
                .linear_velocity_W = spin * Vector3::UnitZ().cross(part.place),
                .angular_velocity_W = spin * Vector3::UnitZ(),
                .friction = friction,
                .restitution = 0});
}

// A box lies between four walls and a floor that turn together and leave it 1e-5 of its size, or nothing at one side. (Straight on their chords they
// closed by 30 times as much within a step: the box was thrown out, or up to 80 of 90 steps failed.)
TEST(Arc, WallsOfOneToolDoNotClose) {
  for (const bool crowd : {false, true}) {
    for (const double dt : {1.0 / 30, 1.0 / 60}) {
      SCOPED_TRACE(::testing::Message() << crowd << dt);
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      const double play = 1e-5;
      const Vector3 box(1.35, 0, 0.2);
      std::vector<Part> tool{{{4, 4, 0.1}, {0, 0, -0.1}}};
      for (const double side : {-1.0, 1.0}) {
        tool.push_back({{0.05, 0.6, 0.2}, box + side * (0.25 + play) * Vector3::UnitX()});
        tool.push_back({{0.2, 0.05, 0.2}, box + side * (0.25 + play) * Vector3::UnitY()});
      }
      AddTool(&world, tool, 0.6);
      world.Add(
          {.shape = Shape::Box({0.2, 0.2, 0.2}), .mass = 1, .position_W = box, .friction = 0.6, .restitution = 0});
      double angle = 0;
      for (int frame = 1; frame * dt < 2; ++frame) {
        angle += 3 * std::min(1.0, frame * dt) * dt;
        TurnTool(&world, tool, angle, dt);
        testing::Step(&world, dt);
        const Vector3 place = Turn(-angle, Vector3::UnitZ()) * world.body(5).position_W;
        EXPECT_LT((place - box).norm(), 5 * play) << frame;
      }
    }
  }
}

// What rides at a turning rim, pressed by nothing but that it goes in a circle, has the velocity of its circle. (It had that of the chord, which leans
// inwards by half of a step's turn.)
TEST(Arc, RidersGoAlongTheTangent) {
  const double spin = 1.5, dt = 1.0 / 60;
  Settings settings = Awake();
  settings.gravity = Vector3::Zero();
  World world(settings);
  const std::vector<Part> rim{{{0.1, 1, 1}, {2.2, 0, 0}}};
  AddTool(&world, rim, 0.5, spin);
  world.Add({.shape = Shape::Box({0.1, 0.1, 0.1}),
             .mass = 1,
             .position_W = {2, 0.3, 0},
             .linear_velocity_W = spin * Vector3(-0.3, 2, 0),
             .angular_velocity_W = spin * Vector3::UnitZ(),
             .friction = 0.5,
             .restitution = 0});
  for (int frame = 1; frame <= 120; ++frame) {
    TurnTool(&world, rim, spin * frame * dt, dt);
    testing::Step(&world, dt);
    const Body& box = world.body(1);
    EXPECT_LT((box.linear_velocity_W - spin * Vector3::UnitZ().cross(box.position_W)).norm(), 1e-3) << frame;
    EXPECT_LT((Turn(-spin * frame * dt, Vector3::UnitZ()) * box.position_W - Vector3(2, 0.3, 0)).norm(), 1e-5) << frame;
  }
}

// A ball falls on a paddle that swings up at it. [m] where it is then.
Vector3 StruckBall(double dt) {
  World world(Awake());
  const double spin = 2.5, start = -1.1;
  const auto place = [](double angle) { return Vector3(std::cos(angle), 0, -std::sin(angle)); };
  const auto turn = [](double angle) { return Turn(angle, Vector3::UnitY()); };
  world.Add({.shape = Shape::Box({0.4, 0.4, 0.05}),
             .kind = BodyKind::kKinematic,
             .position_W = place(start),
             .rotation_WB = turn(start),
             .linear_velocity_W = spin * Vector3::UnitY().cross(place(start)),
             .angular_velocity_W = spin * Vector3::UnitY(),
             .friction = 0.3,
             .restitution = 0.8});
  BodyDefinition ball = testing::Ball(place(start) + Vector3(0.1, 0, 0.55), 0.05, 0.3, 0.8);
  ball.linear_velocity_W = {0.5, 0, -0.3};
  world.Add(ball);
  for (int frame = 1; frame <= std::lround(0.6 / dt); ++frame) {
    const double angle = start + spin * frame * dt;
    world.MoveTo(0, place(angle), turn(angle), dt);
    testing::Step(&world, dt);
  }
  return world.body(1).position_W;
}

// Blows of such walls are of second order in the step, too. (On its chord the paddle was elsewhere, and as fast in another direction.)
TEST(Arc, StrikesWhereItIs) {
  const Vector3 right = StruckBall(1.0 / 3840), fallen = Vector3(0.1, 0, 0.55) + 0.6 * Vector3(0.5, 0, -0.3);
  EXPECT_GT((right - Vector3(std::cos(-1.1), 0, -std::sin(-1.1)) - fallen).norm(), 0.5) << "it was not struck";
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240})
    EXPECT_LT((StruckBall(dt) - right).norm(), 0.1 * dt * dt) << dt;
}

// A wheel that rolls turns, and its velocity does not: it goes straight. What it meets on its way is met as by one that does not turn.
TEST(Arc, IsNoneOfWhatRolls) {
  Vector3 ways[2];
  for (const double spin : {0.0, 5.0}) {
    Settings settings = Awake();
    settings.gravity = Vector3::Zero();
    World world(settings);
    world.Add({.shape = Shape::Sphere(0.2),
               .kind = BodyKind::kKinematic,
               .linear_velocity_W = {1, 0, 0},
               .angular_velocity_W = {0, spin, 0},
               .friction = 0,
               .restitution = 0.5});
    BodyDefinition ball = testing::Ball({0.5, 0.1, 0.1}, 0.1, 0, 0.5);
    world.Add(ball);
    testing::StepTimes(&world, 60, 1.0 / 60);
    ways[spin > 0] = world.body(1).position_W;
  }
  EXPECT_GT(ways[0].x(), 1);
  EXPECT_LT((ways[1] - ways[0]).norm(), 1e-12);
}

// In halves, which a crowd asks for elsewhere, walls stay on their arcs; so they do after a restore.
TEST(Arc, GoesOnInHalvesAndSnapshots) {
  World world(testing::AsCrowd(Awake()));
  const std::vector<Part> tool{{{1, 1, 0.1}, {3, 0, -0.1}}};
  AddTool(&world, tool, 0.8, 1);
  world.Add({.shape = Shape::Box({0.1, 0.1, 0.1}),
             .mass = 1,
             .position_W = {3, 0, 0.1},
             .linear_velocity_W = {0, 3, 0},
             .angular_velocity_W = {0, 0, 1},
             .friction = 0.8,
             .restitution = 0});
  for (int k = 0; k < 8; ++k)
    world.Add({.shape = Shape::Sphere(0.02),
               .mass = 0.1,
               .position_W = {50 + 0.05 * k, 0, 0},
               .linear_velocity_W = {k % 2 == 0 ? 20.0 : -20.0, 0, 5}});
  const double dt = 1.0 / 60;
  for (int frame = 1; frame <= 30; ++frame) {
    if (frame == 15) world.Restore(WorldSnapshot::FromBytes(world.Save().ToBytes()));
    TurnTool(&world, tool, frame * dt, dt);
    testing::Step(&world, dt);
    const Vector3 place = Turn(-frame * dt, Vector3::UnitZ()) * world.body(1).position_W;
    EXPECT_LT((place - Vector3(3, 0, 0.1)).norm(), 1e-5) << frame;
  }
}

}  // namespace
}  // namespace islet
