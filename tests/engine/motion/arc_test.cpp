// Walls that go in a circle: as exact as walls that stand, at any step.
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
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

// A step in which kinematic boxes go to where a tool has them.
void StepTool(World* world, const std::vector<Part>& parts, const Vector3& place, const Quaternion& turn, double dt) {
  for (size_t i = 0; i < parts.size(); ++i) world->MoveTo(static_cast<int>(i), place + turn * parts[i].place, turn, dt);
  testing::Step(world, dt);
}

// Of one that has turned about the vertical.
void TurnTool(World* world, const std::vector<Part>& parts, double angle, double dt) {
  StepTool(world, parts, Vector3::Zero(), Turn(angle, Vector3::UnitZ()), dt);
}

// Their velocities are those of their points, or, where chord [s] is given, those of the chords on which they came here in so long.
void AddTool(World* world, const std::vector<Part>& parts, double friction, double spin = 0, double chord = 0) {
  for (const Part& part : parts) {
    const Vector3 before = Turn(-spin * chord, Vector3::UnitZ()) * part.place;
    world->Add({.shape = Shape::Box(part.half),
                .kind = BodyKind::kKinematic,
                .position_W = part.place,
                .linear_velocity_W = chord > 0 ? Vector3((part.place - before) / chord)
                                               : Vector3(spin * Vector3::UnitZ().cross(part.place)),
                .angular_velocity_W = spin * Vector3::UnitZ(),
                .friction = friction,
                .restitution = 0});
  }
}

// A box of 1 kg that goes along with the tool.
BodyDefinition Rider(const Vector3& half, const Vector3& place, double friction, double spin) {
  return {.shape = Shape::Box(half),
          .mass = 1,
          .position_W = place,
          .linear_velocity_W = spin * Vector3::UnitZ().cross(place),
          .angular_velocity_W = spin * Vector3::UnitZ(),
          .friction = friction,
          .restitution = 0};
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
        const Vector3 place = Turn(-angle, Vector3::UnitZ()) * world.body(5).position_W;
        EXPECT_LT((place - box).norm(), 5 * play) << frame;
      }
    }
  }
}

// Four walls and two lids around a box of 0.4 m.
std::vector<Part> Crate(const Vector3& box, double play) {
  std::vector<Part> crate;
  for (const double side : {-1.0, 1.0})
    for (const int axis : {0, 1, 2}) {
      Vector3 half = Vector3::Constant(0.3);
      half[axis] = 0.05;
      crate.push_back({half, box + side * (0.25 + play) * Vector3::Unit(axis)});
    }
  return crate;
}

// With 1e-5 m of play at each side the box stays where it is, however the crate goes: it travels, is shaken, goes around on a carousel, turns about
// axes that turn, or turns back at once. (Walls went in circles around what stands alone, each as far as its own velocity turned: the box was 6e-4 m
// off, or left.)
TEST(Arc, PartsStayTogetherHoweverTheToolGoes) {
  struct Way {
    const char* name;
    Vector3 (*place)(double t);
    Quaternion (*turn)(double t);
  };
  const Way ways[] = {
      {"travels", [](double t) { return Vector3(3 * t, 2 * t, 0); },
       [](double t) { return Turn(3 * t, Vector3::UnitZ()); }},
      {"is shaken", [](double t) { return Vector3(0.1 * std::sin(12 * t), 0, 0); },
       [](double t) { return Turn(3 * t, Vector3::UnitZ()); }},
      {"on a carousel", [](double t) { return Vector3(2 * std::cos(1.5 * t) - 2, 2 * std::sin(1.5 * t), 0); },
       [](double t) { return Turn(-2.5 * t, Vector3::UnitZ()); }},
      {"on a wrist", [](double t) { return Vector3(t, 0, 0); },
       [](double t) {
         return Quaternion(Turn(0.9 * std::sin(3 * t), Vector3::UnitY()) *
                           Turn(0.6 * std::sin(4 * t), Vector3::UnitX()));
       }},
      {"goes back", [](double t) { return Vector3(t, 0, 0); },
       [](double t) { return Turn(3 * std::abs(std::remainder(t, 0.4)), Vector3::UnitZ()); }},
  };
  const double play = 1e-5;
  const Vector3 box(1.8, 0, 0);
  const std::vector<Part> crate = Crate(box, play);
  for (const Way& way : ways) {
    for (const auto& [crowd, dt] : {std::pair{false, 1.0 / 30}, {false, 1.0 / 60}, {true, 1.0 / 60}}) {
      SCOPED_TRACE(::testing::Message() << way.name << " " << crowd << " " << dt);
      World world(crowd ? testing::AsCrowd(Awake()) : Awake());
      AddTool(&world, crate, 0.6);
      world.Add(
          {.shape = Shape::Box({0.2, 0.2, 0.2}), .mass = 1, .position_W = box, .friction = 0.6, .restitution = 0});
      for (int frame = 1; frame * dt < 1; ++frame) {
        const Vector3 place = way.place(frame * dt);
        const Quaternion turn = way.turn(frame * dt);
        StepTool(&world, crate, place, turn, dt);
        EXPECT_LT((turn.conjugate() * (world.body(6).position_W - place) - box).norm(), 5 * play) << frame;
      }
    }
  }
}

// [m] by which a box moves against a wall that carries it around the origin.
double MovesAgainst(const Vector3& gravity, BodyDefinition wall, BodyDefinition box, const Vector3& spin_W, double dt,
                    double seconds) {
  Settings settings = Awake();
  settings.gravity = gravity;
  World world(settings);
  wall.kind = BodyKind::kKinematic;
  wall.restitution = box.restitution = 0;
  box.mass = 1;
  box.linear_velocity_W = spin_W.cross(box.position_W);
  box.angular_velocity_W = spin_W;
  world.Add(wall);
  world.Add(box);
  Quaternion turn = Quaternion::Identity();
  for (int frame = 1; frame <= seconds / dt; ++frame) {
    turn = testing::Turn(spin_W.norm() * frame * dt, spin_W.normalized());
    world.MoveTo(0, turn * wall.position_W, turn, dt);
    testing::Step(&world, dt);
  }
  return (turn.conjugate() * world.body(1).position_W - box.position_W).norm();
}

// The rim of a centrifuge, without gravity, presses a box outwards at a place where the pull leans by 0.2, and a wall that runs in a circle by three
// times its weight: friction holds both. (On a chord the rim leaves the box, is reached by it and strikes it in each step: it slid for ever.)
TEST(Arc, RimsHoldByFriction) {
  const BodyDefinition rim{.shape = Shape::Box({4, 5, 0.5}), .position_W = {0, 0, -5.5}, .friction = 0.5};
  const BodyDefinition leaning{.shape = Shape::Box({0.25, 0.25, 0.25}), .position_W = {0, 1, -4.75}, .friction = 0.5};
  for (const auto& [spin, dt] : {std::pair{1.0, 1.0 / 30}, {1.0, 1.0 / 60}, {1.4, 1.0 / 60}})
    EXPECT_LT(MovesAgainst(Vector3::Zero(), rim, leaning, {spin, 0, 0}, dt, 5), 1e-4) << spin << " " << dt;
  const BodyDefinition wall{.shape = Shape::Box({0.1, 2, 2}), .position_W = {3.1, 0, 0}, .friction = 0.8};
  const BodyDefinition hanging{.shape = Shape::Box({0.1, 0.1, 0.1}), .position_W = {2.9, 0, 0}, .friction = 0.8};
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240})
    EXPECT_LT(MovesAgainst({0, 0, -kGravity}, wall, hanging, {0, 0, std::sqrt(kGravity)}, dt, 2), 1e-5) << dt;
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
  world.Add(Rider({0.1, 0.1, 0.1}, {2, 0.3, 0}, 0.5, spin));
  for (int frame = 1; frame <= 120; ++frame) {
    TurnTool(&world, rim, spin * frame * dt, dt);
    const Body& box = world.body(1);
    EXPECT_LT((box.linear_velocity_W - spin * Vector3::UnitZ().cross(box.position_W)).norm(), 1e-3) << frame;
    EXPECT_LT((Turn(-spin * frame * dt, Vector3::UnitZ()) * box.position_W - Vector3(2, 0.3, 0)).norm(), 1e-5) << frame;
  }
}

// A world may begin with the velocity of the wall's point, or, as one that is built from what another shows, with that of its chord. (What rode on it
// was slung 10 mm off in the first two steps.)
TEST(Arc, BeginsFromEitherVelocity) {
  const double spin = 10, dt = 1.0 / 30;
  const std::vector<Part> rim{{{0.05, 1, 1}, {1.05, 0, 0}}};
  const Vector3 box(0.9, 0, 0);
  for (const bool of_chord : {false, true}) {
    World world(Awake());
    AddTool(&world, rim, 0.6, spin, of_chord ? dt : 0);
    world.Add(Rider({0.1, 0.1, 0.1}, box, 0.6, spin));
    for (int frame = 1; frame <= 3; ++frame) {
      TurnTool(&world, rim, spin * frame * dt, dt);
      EXPECT_LT((Turn(-spin * frame * dt, Vector3::UnitZ()) * world.body(1).position_W - box).norm(), 1e-4) << of_chord;
    }
  }
}

// A ball falls on a paddle that swings up at it, both seen from a frame that travels by -travel_W [m/s]. [m] where it is then, in theirs.
Vector3 StruckBall(double dt, const Vector3& travel_W = Vector3::Zero()) {
  World world(Awake());
  const double spin = 2.5, start = -1.1;
  const auto place = [](double angle) { return Vector3(std::cos(angle), 0, -std::sin(angle)); };
  const auto turn = [](double angle) { return Turn(angle, Vector3::UnitY()); };
  world.Add({.shape = Shape::Box({0.4, 0.4, 0.05}),
             .kind = BodyKind::kKinematic,
             .position_W = place(start),
             .rotation_WB = turn(start),
             .linear_velocity_W = spin * Vector3::UnitY().cross(place(start)) + travel_W,
             .angular_velocity_W = spin * Vector3::UnitY(),
             .friction = 0.3,
             .restitution = 0.8});
  BodyDefinition ball = testing::Ball(place(start) + Vector3(0.1, 0, 0.55), 0.05, 0.3, 0.8);
  ball.linear_velocity_W = Vector3(0.5, 0, -0.3) + travel_W;
  world.Add(ball);
  for (int frame = 1; frame <= std::lround(0.6 / dt); ++frame) {
    const double angle = start + spin * frame * dt;
    world.MoveTo(0, place(angle) + frame * dt * travel_W, turn(angle), dt);
    testing::Step(&world, dt);
  }
  return world.body(1).position_W - 0.6 * travel_W;
}

// Blows of such walls are of second order in the step, too. (On its chord the paddle was elsewhere, and as fast in another direction.)
TEST(Arc, StrikesWhereItIs) {
  const Vector3 right = StruckBall(1.0 / 3840), fallen = Vector3(0.1, 0, 0.55) + 0.6 * Vector3(0.5, 0, -0.3);
  EXPECT_GT((right - Vector3(std::cos(-1.1), 0, -std::sin(-1.1)) - fallen).norm(), 0.5) << "it was not struck";
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240})
    EXPECT_LT((StruckBall(dt) - right).norm(), 0.1 * dt * dt) << dt;
}

// A circle is one in a frame that travels, too. (Its centre had to stand: the ball was off by 1.6 cm.)
TEST(Arc, IsTheSameInAFrameThatTravels) {
  for (const double dt : {1.0 / 30, 1.0 / 60})
    EXPECT_LT((StruckBall(dt, {3, 2, 0}) - StruckBall(dt)).norm(), 1e-9) << dt;
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
    BodyDefinition other = testing::Ball(
        {0, 0, 50}, 1, 0, 0);  // its velocity changes: who asks for that in the world finds the wheel, too
    other.kind = BodyKind::kKinematic;
    world.Add(other);
    for (int frame = 0; frame < 60; ++frame) {
      world.SetVelocity(2, {0, 0, 0.1 * frame}, Vector3::Zero());
      testing::Step(&world, 1.0 / 60);
    }
    ways[spin > 0] = world.body(1).position_W;
  }
  EXPECT_GT(ways[0].x(), 1);
  EXPECT_LT((ways[1] - ways[0]).norm(), 1e-12);
}

// A tray that goes in a circle with a box on it becomes dynamic: both go on as they went. (The tray had the velocity of its chord.)
TEST(Arc, GoesOnAlongTheTangentIfLetGo) {
  for (const bool crowd : {false, true}) {
    Settings settings = crowd ? testing::AsCrowd(Awake()) : Awake();
    settings.gravity = Vector3::Zero();
    World world(settings);
    const double spin = 2.5, dt = 1.0 / 30;
    const std::vector<Part> tool{{{0.1, 0.5, 0.5}, {1.2, 0, 0}}};
    AddTool(&world, tool, 0.8, spin);
    world.Add(Rider({0.1, 0.1, 0.1}, {1, 0, 0}, 0.8, spin));
    for (int frame = 1; frame <= 10; ++frame) {
      TurnTool(&world, tool, spin * frame * dt, dt);
    }
    world.SetKind(0, BodyKind::kDynamic);
    const Vector3 apart = world.body(1).linear_velocity_W - world.body(0).linear_velocity_W,
                  around = spin * Vector3::UnitZ().cross(world.body(1).position_W - world.body(0).position_W);
    EXPECT_LT((apart - around).norm(), 0.01) << crowd;
  }
}

// The ledger sees walls on their arcs, too: in a third of a right angle a chord goes through the thin plate that the wall carries.
TEST(Arc, LedgerSeesThem) {
  World world(Awake());
  const double spin = 15, dt = 1.0 / 30;
  const std::vector<Part> tool{{{0.1, 0.5, 0.5}, {1.12, 0, 0}}};
  AddTool(&world, tool, 0.8, spin);
  world.Add(Rider({0.02, 0.2, 0.2}, {1, 0, 0}, 0.8, spin));
  for (int frame = 1; frame <= 10; ++frame) {
    TurnTool(&world, tool, spin * frame * dt, dt);
  }
}

// In halves, which a crowd asks for elsewhere, walls stay on their arcs.
TEST(Arc, GoesOnInHalves) {
  Settings settings = Awake();
  settings.group_bodies = 1;
  World world(settings);
  const std::vector<Part> tool{{{1, 1, 0.1}, {3, 0, -0.1}}};
  AddTool(&world, tool, 0.8, 1);
  for (const double z : {0.1, 0.3}) world.Add(Rider({0.1, 0.1, 0.1}, {3, 0, z}, 0.8, 1));
  testing::AddPassersBy(&world);
  const double dt = 1.0 / 60;
  for (int frame = 1; frame <= 10; ++frame) {
    TurnTool(&world, tool, frame * dt, dt);
    const Body& box = world.body(1);
    EXPECT_LT((Turn(-frame * dt, Vector3::UnitZ()) * box.position_W - Vector3(3, 0, 0.1)).norm(), 1e-5) << frame;
    EXPECT_LT((box.linear_velocity_W - Vector3::UnitZ().cross(box.position_W)).head<2>().norm(), 3e-3) << frame;
  }
}

// A lift that is moved to poses of one rotation goes straight, whatever rounding makes of that rotation.
TEST(Arc, IsNoneOfWhatKeepsItsRotation) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 400; ++k) {
    const Quaternion turned = Quaternion(normal(random), normal(random), normal(random), normal(random)).normalized();
    World world(Awake());
    world.Add({.shape = Shape::Box({1, 1, 0.1}), .kind = BodyKind::kKinematic, .rotation_WB = turned});
    const Quaternion kept = world.body(0).rotation_WB;
    double z = 0;
    for (const double speed : {0.5, 0.6, 1.0, 0.0}) {
      z += speed / 60;
      world.MoveTo(0, {0, 0, z}, kept, 1.0 / 60);
      world.Step(1.0 / 60);
      EXPECT_TRUE(world.body(0).beyond_before_W.isZero(0)) << k;
    }
  }
}

// A restored world goes on along the same arcs, as they speed up and in a step of another length, too.
TEST(Arc, IsInSnapshots) {
  const std::vector<Part> tool{{{1, 1, 0.1}, {3, 0, -0.1}}};
  World world(Awake());
  AddTool(&world, tool, 0.5, 1);
  world.Add({.shape = Shape::Box({0.1, 0.1, 0.1}), .mass = 1, .position_W = {3, 0, 0.1}, .friction = 0.5});
  const auto drive = [&](World* w, double spin, double dt) {  // faster and faster
    const double angle = std::atan2(w->body(0).position_W.y(), w->body(0).position_W.x()) + spin * dt;
    TurnTool(w, tool, angle, dt);
  };
  for (int frame = 0; frame < 5; ++frame) drive(&world, 1 + 0.1 * frame, 1.0 / 60);
  World other(Awake());
  other.Restore(WorldSnapshot::FromBytes(world.Save().ToBytes()));
  for (World* w : {&world, &other}) drive(w, 1.7, 1.0 / 40);
  EXPECT_EQ(world.StateHash(), other.StateHash());
}

}  // namespace
}  // namespace islet
