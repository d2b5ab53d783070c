// Crowds by the law of the step (engine/motion/crowd/crowd.h): what the ledger says of heaps of anything, and what comes to rest.
#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::AddWalls;
using testing::Awake;
using testing::Ball;
using testing::Cube;
using testing::Energy;
using testing::Floor;
using testing::kGravity;

Settings ByLaw(int threads = 2) {
  Settings settings;
  settings.threads = threads;
  return settings;
}

struct Course {
  int unclean = 0, sides = 0;
  double energy = 0, momentum = 0, angular = 0, way = 0, overlap = 0, fresh = 0, fastest = 0;
};

// The worst of each; fastest: of any point in the last step.
Course StepFor(World* world, double dt, double seconds) {
  Course run;
  double before = 0;
  for (const double end = world->time() + seconds; world->time() < end;) {
    const StepReport report = world->Step(dt);
    run.unclean += !report.ledger.Clean();
    run.sides += report.ledger.sides_changed;
    run.energy = std::max(run.energy, report.ledger.energy_created.value);
    run.momentum = std::max(run.momentum, report.ledger.momentum_unexplained.value);
    run.angular = std::max(run.angular, report.ledger.angular_momentum_unexplained.value);
    run.way = std::max(run.way, report.ledger.displacement_without_velocity.value);
    run.fresh = std::max(run.fresh, report.penetration_max - before);
    before = report.penetration_max;
    run.overlap = std::max(run.overlap, report.penetration_max);
  }
  for (const Body& b : world->bodies())
    if (b.kind == BodyKind::kDynamic)
      run.fastest = std::max(run.fastest, b.linear_velocity_W.norm() + b.radius * b.angular_velocity_W.norm());
  return run;
}

void AddTumblingCubes(World* world, int count) {
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < count; ++i) {
    BodyDefinition cube = Cube({0.9 * uniform(rng), 0.9 * uniform(rng), 1 + 0.9 * i}, 0.5, 0.2);
    cube.shape = Shape::Box({0.25, 0.25, 0.25});
    cube.mass = 1;
    cube.rotation_WB = testing::Turn(3 * uniform(rng), Vector3(uniform(rng), uniform(rng), 1.1));
    world->Add(cube);
  }
}

// What falls, tumbles and piles up makes no energy, needs no impulse that is not told, and moves by its velocities alone.
TEST(Crowd, HeapObeysTheLawInEveryStep) {
  for (const double dt : {1.0 / 30, 1.0 / 240}) {
    SCOPED_TRACE(dt);
    Settings settings = ByLaw();
    settings.freezing = Freezing::kOff;
    World world(settings);
    world.Add(Floor(0.5, 0.2));
    AddWalls(&world, 2, 2.5, 3);
    AddTumblingCubes(&world, 60);
    const Course run = StepFor(&world, dt, 4);
    EXPECT_EQ(run.unclean, 0) << run.energy << " " << run.momentum << " " << run.angular;
    EXPECT_LT(run.momentum, 1e-11);
    EXPECT_LT(run.angular, 1e-11);
    EXPECT_LT(run.way, 1e-13);
    EXPECT_LT(run.fresh, 2e-3 * 0.5);    // what a piece may make
    EXPECT_LT(run.overlap, 3e-3 * 0.5);  // what is there is taken back a fifth in a piece
  }
}

// Tiles that are level make one floor: their edges stop nobody, in a crowd neither.
TEST(Crowd, CubesSlideOverLevelTilesAsOverOneFloor) {
  for (const double dt : {1.0 / 60, 1.0 / 240}) {
    World world(testing::AsCrowd(ByLaw()));
    for (int x = 0; x < 8; ++x)
      for (int y = 0; y < 8; ++y)
        world.Add({.shape = Shape::Box({0.5, 0.5, 0.25}),
                   .kind = BodyKind::kFixed,
                   .position_W = {x + 0.5, y + 0.5, -0.25},
                   .friction = 0});
    std::vector<int> cubes;
    for (const double turn : {0.0, 0.3, 0.7}) {
      BodyDefinition cube{.shape = Shape::Box({0.3, 0.3, 0.3}),
                          .position_W = {1.31, 1.2 + 2.0 * static_cast<double>(cubes.size()), 0.3},
                          .friction = 0};
      cube.rotation_WB = Quaternion(Eigen::AngleAxisd(turn, Vector3::UnitZ()));
      cube.linear_velocity_W = {3, 0.2, 0};
      cubes.push_back(world.Add(cube));
    }
    for (const double end = 1.5; world.time() < end;) world.Step(dt);
    for (const int i : cubes) {
      EXPECT_LT((world.body(i).linear_velocity_W - Vector3(3, 0.2, 0)).norm(), 1e-8) << i << " " << dt;
      EXPECT_NEAR(world.body(i).position_W.z(), 0.3, 1e-8) << i << " " << dt;
    }
  }
}

// A floor goes in a circle and presses boxes outwards. Off the foot of the radius its normal comes towards a box by its chord, though they
// never part: taken for parting that nobody may gain by, it let them sink by a hundredth of a size a minute, for ever.
TEST(Crowd, CirclingFloorsAreNotSunkInto) {
  const double dt = 1.0 / 30, radius = 5, half = 0.25;
  Settings settings = testing::AsCrowd(testing::Awake());
  settings.gravity.setZero();
  World world(settings);
  const int floor = world.Add({.shape = Shape::Box({4, radius, 0.5}),
                               .kind = BodyKind::kKinematic,
                               .position_W = {0, 0, -radius - 0.5},
                               .friction = 0.9,
                               .restitution = 0});
  std::vector<Vector3> places;
  for (int i = -2; i <= 2; ++i)
    for (int k = 0; k < 5; ++k) {
      places.emplace_back(0.55 * i, 0.55 * k, half - radius);
      world.Add({.shape = Shape::Box({half, half, half}),
                 .mass = 1,
                 .position_W = places.back(),
                 .linear_velocity_W = Vector3::UnitX().cross(places.back()),
                 .angular_velocity_W = Vector3::UnitX(),
                 .friction = 0.9,
                 .restitution = 0});
    }
  Quaternion turn = Quaternion::Identity();
  for (int frame = 1; frame <= 300; ++frame) {
    turn = testing::Turn(frame * dt, Vector3::UnitX());
    world.MoveTo(floor, turn * Vector3(0, 0, -radius - 0.5), turn, dt);
    testing::Step(&world, dt);
  }
  for (size_t k = 0; k < places.size(); ++k) {
    const Vector3 moved = turn.conjugate() * world.body(floor + 1 + static_cast<int>(k)).position_W - places[k];
    EXPECT_GT(moved.z(), -2e-4) << k;
    EXPECT_LT(moved.norm(), 1e-3) << k;
  }
}

// A lip is met by its side, and whatever falls past a ledge by its edge, however slightly: half a hundredth of a size passed for what may
// overlap, and the cube went on over it.
TEST(Crowd, LipsAndLedgesAreMet) {
  for (const double rate : {60.0, 240.0}) {
    for (const double lip : {5e-4, 1e-3}) {
      World sliding(testing::AsCrowd(Awake())), falling(testing::AsCrowd(Awake()));
      for (const double side : {-1.0, 1.0})
        sliding.Add({.shape = Shape::Box({2, 0.5, 0.5}),
                     .kind = BodyKind::kFixed,
                     .position_W = {2 * side, 0, side > 0 ? lip - 0.5 : -0.5},
                     .friction = 0.2});
      BodyDefinition cube = {.shape = Shape::Box({0.1, 0.1, 0.1}),
                             .mass = 1,
                             .position_W = {-0.25, 0, 0.1},
                             .linear_velocity_W = {1.5, 0, 0},
                             .friction = 0.2};
      sliding.Add(cube);
      falling.Add({.shape = Shape::Box({0.5, 0.5, 0.5}),
                   .kind = BodyKind::kFixed,
                   .position_W = {lip - 0.6, 0, -0.5},
                   .friction = 0.2});
      cube.position_W = {0, 0, 0.4};
      cube.linear_velocity_W.setZero();
      falling.Add(cube);
      testing::StepTimes(&sliding, static_cast<int>(0.4 * rate), 1 / rate);
      testing::StepTimes(&falling, static_cast<int>(0.27 * rate), 1 / rate);
      EXPECT_LT(sliding.body(2).position_W.x(), -0.05) << rate << " " << lip;  // over it: 0.2
      EXPECT_GT(falling.body(1).angular_velocity_W.norm(), 5) << rate << " " << lip;
    }
  }
}

// What a body loses on one wall is not another's to gain.
TEST(Crowd, BlowsOfOneBodyGiveNothingToTheNext) {
  World world(testing::AsCrowd(ByLaw()));
  world.Add(Floor(0.5, 1));
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 20; ++i) {
    BodyDefinition stick{.shape = Shape::Box({0.3, 0.015, 0.015}),
                         .position_W = {uniform(rng), uniform(rng), 0.5 + 0.2 * i},
                         .friction = 0.5,
                         .restitution = 0.5};
    stick.rotation_WB =
        Quaternion(Eigen::AngleAxisd(uniform(rng), Vector3(uniform(rng), uniform(rng), 1).normalized()));
    stick.angular_velocity_W = {10 * uniform(rng), 10 * uniform(rng), 10 * uniform(rng)};
    world.Add(stick);
  }
  EXPECT_LT(StepFor(&world, 1.0 / 240, 2).energy, 1e-6);
}

// Columns that touch side by side do not press each other.
TEST(Crowd, FlushColumnsDoNotPressEachOther) {
  World world(ByLaw());
  world.Add(Floor(0.5, 0));
  for (int i = 0; i < 15; ++i) {
    for (int k = 0; k < 3; ++k) {
      world.Add({.shape = Shape::Box({0.1, 0.1, 0.05}),
                 .mass = 4,
                 .position_W = {0.2 * (i - 7), 0, 0.05 + 0.1 * k},
                 .friction = 0.5,
                 .restitution = 0});
    }
  }
  for (int step = 0; step < 18; ++step) {
    testing::Step(&world, 1.0 / 60);
    double side = 0, all = 0;
    for (const Vector3& impulse_W : world.impulses()) {
      all += impulse_W.norm();
      side += std::abs(impulse_W.x());
    }
    EXPECT_LT(side, 1e-6 * all) << step;
  }
}

// What is closed stays as it is, or what one step misses would be a velocity of the next.
TEST(Crowd, HeapOfCubesComesToRest) {
  World world(ByLaw());
  world.Add(Floor(0.5, 0.2));
  AddWalls(&world, 2, 2.5, 3);
  AddTumblingCubes(&world, 60);
  const Course fall = StepFor(&world, 1.0 / 30, 11);
  EXPECT_EQ(fall.sides, 0);
  for (const Body& b : world.bodies()) EXPECT_TRUE(b.kind != BodyKind::kDynamic || b.frozen);
  EXPECT_EQ(fall.fastest, 0);
}

// Once the last body is as slow as 1e-6, a few frames are enough, whoever rests in a crowd and whoever in a small group. Of two edges that
// are all but parallel detection finds now this point and now that one: groups that remembered these did not balance for 50 to 150 frames,
// and a crowd whose impulses were not exact to 1e-10 of its weight never froze.
TEST(Crowd, HeapsFreezeAsSoonAsTheyStand) {
  for (const unsigned seed : {1U, 2U, 3U, 4U, 23U}) {
    World world(ByLaw());
    world.Add(Floor(0.5, 0.2));
    for (int side = 0; side < 4; ++side) {
      BodyDefinition wall = Floor(0.5, 0.2);
      const Vector3 inward(std::cos(0.5 * M_PI * side), std::sin(0.5 * M_PI * side), 0);
      wall.position_W = -2.5 * inward;
      wall.rotation_WB = Quaternion::FromTwoVectors(Vector3::UnitZ(), inward);
      world.Add(wall);
    }
    std::mt19937 rng(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int i = 0; i < 60; ++i) {
      BodyDefinition cube = Cube({0.9 * uniform(rng), 0.9 * uniform(rng), 1 + 0.9 * i}, 0.5, 0.2);
      cube.shape = Shape::Box({0.25, 0.25, 0.25});
      cube.mass = 1;
      const double z = uniform(rng), y = uniform(rng), x = uniform(rng), turn = 3 * uniform(rng);
      cube.rotation_WB = Quaternion(Eigen::AngleAxisd(turn, Vector3(x, y, z).normalized()));
      world.Add(cube);
    }
    int standing = 0;
    for (int frame = 0; frame < 400; ++frame) {
      if (world.Step(1.0 / 30).awake == 0) break;
      double fastest = 0;
      for (const Body& b : world.bodies())
        fastest = std::max(fastest, b.linear_velocity_W.norm() + b.angular_velocity_W.norm());
      standing = fastest < 1e-6 ? standing + 1 : 0;
      ASSERT_LE(standing, 8) << seed;
    }
    for (const Body& b : world.bodies()) EXPECT_TRUE(b.kind != BodyKind::kDynamic || b.frozen) << seed;
  }
}

// Corrections of poses lifted them for nothing: they never came to rest.
TEST(Crowd, CardsComeToRest) {
  World world(ByLaw());
  world.Add(Floor(0.5, 0.2));
  AddWalls(&world, 0.75, 1.25, 1);
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 30; ++i) {
    BodyDefinition card = Cube({0.15 * uniform(rng), 0.15 * uniform(rng), 0.1 + 0.125 * i}, 0.5, 0.2);
    card.shape = Shape::Box({0.05, 0.035, 0.001});
    card.mass = 0.01;
    card.inertia_B.reset();
    card.rotation_WB = testing::Turn(3 * uniform(rng), Vector3(uniform(rng), uniform(rng), 1.1));
    world.Add(card);
  }
  const Course run = StepFor(&world, 1.0 / 60, 5);
  EXPECT_EQ(run.sides, 0);
  EXPECT_LT(run.energy, 1e-4);
  EXPECT_LT(run.fastest, 1e-3);
}

// It stood still while its velocity grew, and struck with energy that was never there.
TEST(Crowd, HeavyLidOnLightBallsComesDownAsFarAsTheyGiveWay) {
  World world(ByLaw());
  world.Add(Floor(0.5, 0));
  AddWalls(&world, 1.5, 2, 1.5);
  for (int i = 0; i < 98; ++i) {
    BodyDefinition ball = Ball({-0.83 + 0.275 * (i % 7) + 0.003 * (i % 5),
                                -0.83 + 0.275 * (i / 7 % 7) + 0.003 * (i % 3), 0.14 + 0.27 * (i / 49)},
                               0.13, 0.5, 0);
    ball.mass = 0.09;
    world.Add(ball);
  }
  BodyDefinition lid = Cube({0, 0, 0.7}, 0.5, 0);
  lid.shape = Shape::Box({0.97, 0.97, 0.1});
  lid.mass = 90;
  lid.inertia_B.reset();
  const int top = world.Add(lid);
  const double fall = 0.7 - 0.1 - 0.27, start = Energy(world.bodies());
  double fastest = 0;
  for (int frame = 0; frame < 120; ++frame) {
    const Course run = StepFor(&world, 1.0 / 60, 1.0 / 60);
    EXPECT_EQ(run.sides, 0) << frame;
    fastest = std::max(fastest, world.body(top).linear_velocity_W.norm());
    ASSERT_LE(Energy(world.bodies()), start * (1 + 1e-6)) << frame;
  }
  EXPECT_LT(fastest, std::sqrt(2 * 9.81 * fall));
  EXPECT_GT(world.body(top).position_W.z(), 0.25);
  EXPECT_LT(world.body(top).linear_velocity_W.norm(), 0.5);
}

TEST(Crowd, SameBitsForAnyNumberOfThreadsAndFromASnapshot) {
  std::vector<std::uint64_t> hashes;
  for (const int threads : {1, 2, 4}) {
    World world(ByLaw(threads));
    world.Add(Floor(0.5, 0.2));
    AddWalls(&world, 2, 2.5, 3);
    AddTumblingCubes(&world, 40);
    StepFor(&world, 1.0 / 30, 1.5);
    const WorldSnapshot half = world.Save();
    StepFor(&world, 1.0 / 30, 1);
    hashes.push_back(world.StateHash());
    world.Restore(half);
    StepFor(&world, 1.0 / 30, 1);
    EXPECT_EQ(world.StateHash(), hashes.back());
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_EQ(hashes[0], hashes[2]);
}

// What lifts a heap pays for it: the ledger knows the work of moving walls.
TEST(Crowd, PlateThatMovesCarriesAHeap) {
  World world(ByLaw());
  BodyDefinition plate = Cube({0, 0, -0.5}, 0.5, 0.2);
  plate.shape = Shape::Box({3, 3, 0.5});
  plate.kind = BodyKind::kKinematic;
  plate.mass.reset();
  plate.linear_velocity_W = {0, 0, 0.5};
  world.Add(plate);
  for (int i = 0; i < 36; ++i) {
    BodyDefinition cube = Cube({-1.4 + 0.56 * (i % 6), -1.4 + 0.56 * (i / 6 % 3), 0.25 + 0.5 * (i / 18)}, 0.5, 0.2);
    cube.shape = Shape::Box({0.25, 0.25, 0.25});
    cube.linear_velocity_W = {0, 0, 0.5};
    world.Add(cube);
  }
  const Course run = StepFor(&world, 1.0 / 60, 2);
  EXPECT_EQ(run.unclean, 0) << run.energy << " " << run.momentum;
  for (int i = 1; i < 37; ++i) EXPECT_NEAR(world.body(i).linear_velocity_W.z(), 0.5, 1e-6) << i;
}

// A drum of twelve plates turns sixty boxes over: what it lifts them by is no gain, and no step needs more than its passes.
TEST(Crowd, DrumTumblesBoxes) {
  World world(ByLaw());
  std::vector<int> plates;
  for (int i = 0; i < 12; ++i) {
    const double angle = 2 * M_PI * i / 12;
    BodyDefinition plate{.shape = Shape::Box({0.3, 0.6, 0.05}), .kind = BodyKind::kKinematic};
    plate.position_W = {1.02 * std::cos(angle), 0, 1.02 * std::sin(angle)};
    plate.rotation_WB = testing::Turn(M_PI / 2 - angle, Vector3::UnitY());
    plates.push_back(world.Add(plate));
  }
  for (const double side : {-1.0, 1.0}) {
    BodyDefinition end{.shape = Shape::Box({1.5, 0.1, 1.5}), .kind = BodyKind::kFixed};
    end.position_W = {0, 0.65 * side, 0};
    world.Add(end);
  }
  std::mt19937 random(5);
  std::uniform_real_distribution<double> in(-1, 1);
  std::vector<int> boxes;
  for (int i = 0; i < 60; ++i) {
    BodyDefinition box{.shape = Shape::Box({0.08, 0.07, 0.06})};
    box.position_W = {-0.5 + 0.25 * (i % 5), -0.375 + 0.25 * (i / 5 % 4), -0.4 + 0.25 * (i / 20)};
    box.rotation_WB = Quaternion(in(random), in(random), in(random), in(random)).normalized();
    boxes.push_back(world.Add(box));
  }
  for (int frame = 0; frame < 120; ++frame) {
    const Vector3 spin(0, 1, 0);
    for (const int plate : plates) world.SetVelocity(plate, spin.cross(world.body(plate).position_W), spin);
    const StepReport report = world.Step(1.0 / 60);
    EXPECT_TRUE(report.ledger.Clean()) << frame;
    EXPECT_EQ(report.motion_failures, 0) << frame;
  }
  for (const int i : boxes) EXPECT_LE(std::hypot(world.body(i).position_W.x(), world.body(i).position_W.z()), 1.1) << i;
}

// A rod that spins lands on a floor that creeps as on one that stands: no contact gives way to speeds that it brings.
TEST(Crowd, SpinningRodLandsOnAFloorThatCreeps) {
  Vector3 left[2];
  for (const int creeps : {0, 1}) {
    World world(testing::AsCrowd(ByLaw(1)));
    BodyDefinition floor = Floor(0.5, 0);
    floor.kind = BodyKind::kKinematic;
    floor.linear_velocity_W = {0, 0, 1e-6 * creeps};
    world.Add(floor);
    BodyDefinition rod = Cube({0, 0, 0.12}, 0.5, 0.5);
    rod.shape = Shape::Box({1, 0.05, 0.05});
    rod.angular_velocity_W = {0, 20, 0};
    const int number = world.Add(rod);
    for (int frame = 0; frame < 5; ++frame) world.Step(1.0 / 240);
    left[creeps] = world.body(number).linear_velocity_W;
  }
  EXPECT_GT(left[0].norm(), 1);
  EXPECT_LE((left[1] - left[0]).norm(), 1e-4) << left[0].transpose() << ", " << left[1].transpose();
}

// Fourteen balls are no crowd. A ram squeezes them until the way from blow to blow is beyond the work of a step: no body is left behind.
TEST(Crowd, TakesOverWhatIsBeyondTheWorkOfAGroup) {
  World world(ByLaw(1));
  world.Add(Floor());
  AddWalls(&world, 1.5, 2, 2);
  for (const double side : {-1.0, 1.0}) {
    BodyDefinition wall{.shape = Shape::Box({2, 0.5, 2}), .kind = BodyKind::kFixed};
    wall.position_W = {0, side, 2};
    world.Add(wall);
  }
  for (int i = 0; i < 14; ++i)
    world.Add(Ball({0.5 + 0.25 * (i % 2), -0.3 + 0.25 * (i / 2 % 3), 0.15 + 0.25 * (i / 6)}, 0.12, 0.5, 0.5));
  BodyDefinition ram{.shape = Shape::Box({0.3, 0.45, 0.6}), .kind = BodyKind::kKinematic};
  ram.position_W = {-0.2, 0, 0.65};
  const int number = world.Add(ram);
  for (int frame = 0; frame < 75; ++frame) {
    world.SetVelocity(number, {0.5, 0, 0}, Vector3::Zero());
    EXPECT_EQ(world.Step(1.0 / 60).unstepped, 0) << frame;
  }
}

// A wall of bricks in running bond, twenty rows high and half a metre thick: it stands, is solved as exactly as that needs, and freezes.
// By as many sweeps as what moves gets it leaned by 2e-4 m in half a second, and never froze.
TEST(Crowd, BrickWallStandsAndFreezes) {
  for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
    World world(ByLaw());
    world.Add(Floor(0.6, 0.1));
    const auto add = [&](double x, double z, double half) {
      BodyDefinition brick = Cube({x, 0, z}, 0.6, 0.1);
      brick.shape = Shape::Box({half, 0.25, 0.25});
      brick.mass = 0.5 * half;
      world.Add(brick);
    };
    constexpr int kRows = 20, kColumns = 8;
    for (int row = 0; row < kRows; ++row) {
      const double z = 0.25 + 0.5 * row;
      for (int i = 0; i < kColumns; ++i)
        if (row % 2 == 0 || i < kColumns - 1) add(row % 2 == 0 ? i : i + 0.5, z, 0.5);
      if (row % 2 == 1) add(-0.25, z, 0.25), add(kColumns - 0.75, z, 0.25);
    }
    const std::vector<Body> before(world.bodies().begin(), world.bodies().end());
    StepReport report;
    for (double t = 0; t < 0.9; t += dt) {
      report = world.Step(dt);
      EXPECT_FALSE(report.Failed()) << t;
    }
    EXPECT_EQ(report.awake, 0) << dt;
    for (size_t i = 0; i < before.size(); ++i)
      EXPECT_LT((world.bodies()[i].position_W - before[i].position_W).norm(), 2e-6) << i << " at " << dt;
  }
}

// A piston runs into balls that rest, and were frozen. What the step found before they woke is forgotten: contacts that gave way as
// between closing walls went on doing so, and balls stayed in each other.
TEST(Crowd, PistonPushesWhatWasFrozen) {
  for (const int count : {3, 24}) {
    World world(count == 3 ? testing::AsCrowd(ByLaw()) : ByLaw());
    world.Add(Floor(0));
    for (int i = 0; i < count; ++i) world.Add(Ball({0.501 * i, 0, 0.25}, 0.25, 0, 0.2));
    const int piston =
        world.Add({.shape = Shape::Box({0.5, 0.5, 0.5}), .kind = BodyKind::kKinematic, .position_W = {-1.75, 0, 0.6}});
    for (int frame = 0; frame < 120; ++frame) {
      world.SetVelocity(piston, {frame < 40 ? 0.0 : 2.0, 0, 0}, Vector3::Zero());
      const StepReport report = world.Step(1.0 / 60);
      EXPECT_FALSE(report.Failed()) << frame;
      for (int i = 1; i < count; ++i)
        EXPECT_GT((world.body(i + 1).position_W - world.body(i).position_W).norm(), 0.5 - 1e-3) << i << " at " << frame;
    }
    EXPECT_GT(world.body(1).linear_velocity_W.x(), 1.9);
  }
}

// 27 boxes that rest, and a wall that comes among them: who is frozen is no wall where the others have nowhere to go. It crept before, or the
// steps were short, so that what was near was known for a way far shorter than the one that it takes.
TEST(Crowd, WallPushesFrozenBoxes) {
  for (const double short_step : {1.0 / 60, 1.0 / 6000}) {
    World world(testing::AsCrowd(Settings{}));
    world.Add(Floor());
    for (int i = 0; i < 27; ++i) world.Add(Cube({1.01 * (i % 3), 1.01 * (i / 3 % 3), 0.5 + i / 9}));
    const int wall =
        world.Add({.shape = Shape::Box({0.1, 2, 2}), .kind = BodyKind::kKinematic, .position_W = {2.8, 1, 2.1}});
    for (int k = 0; k < 60; ++k) world.Step(1.0 / 60);
    world.SetVelocity(wall, {short_step < 0.01 ? -8 : -1e-4, 0, 0}, Vector3::Zero());
    world.Step(short_step);
    ASSERT_TRUE(world.body(1).frozen);
    if (short_step > 0.01) world.SetVelocity(wall, {-8, 0, 0}, Vector3::Zero());
    for (int k = 0; k < 3; ++k) EXPECT_EQ(world.Step(1.0 / 15).overlapping, 0) << short_step << ", " << k;
  }
}

// A plane turns far away, and comes down on frozen boxes by more in a step than what is near them.
TEST(Crowd, PlaneThatTurnsMeetsFrozenBoxes) {
  World world(testing::AsCrowd(Settings{}));
  world.Add(Floor());
  for (int i = 0; i < 9; ++i) world.Add(Cube({1.01 * (i % 3), 0, 0.5 + i / 3}));
  const int plane = world.Add({.shape = Shape::HalfSpace(),
                               .kind = BodyKind::kKinematic,
                               .position_W = {1, 0, -30},
                               .rotation_WB = testing::Turn(-0.5 * M_PI + 0.07, Vector3::UnitY())});
  for (int k = 0; k < 60; ++k) world.Step(1.0 / 60);
  for (int k = 0; k < 8; ++k) {
    world.SetVelocity(plane, Vector3::Zero(), {0, -0.25, 0});
    EXPECT_EQ(world.Step(1.0 / 60).overlapping, 0) << k;
  }
  EXPECT_LT(world.body(3).position_W.x(), 2.0);
}

// A box that turns with a round table: its contacts are found again where it is, or what they carried would stay, and its rate would go to
// and fro about the table's for ever.
TEST(Crowd, WhatTurnsWithATableTurnsAsItDoes) {
  for (const auto& [half, rate, dt] :
       {std::tuple{Vector3(0.025, 0.025, 0.025), 4.0, 1.0 / 30}, {Vector3(0.2, 0.2, 0.05), 1.5, 1.0 / 60}}) {
    World world(testing::AsCrowd(testing::Awake()));
    world.Add({.shape = Shape::Cylinder(2, 0.1),
               .kind = BodyKind::kKinematic,
               .position_W = {0, 0, -0.1},
               .angular_velocity_W = {0, 0, rate}});
    const int box = world.Add({.shape = Shape::Box(half), .position_W = {0, 0, half.z()}, .restitution = 0});
    for (int frame = 0; frame < 120; ++frame) {
      EXPECT_FALSE(world.Step(dt).Failed());
      if (frame < 60) continue;  // until it is carried along
      EXPECT_NEAR(world.body(box).angular_velocity_W.z(), rate, 1e-6) << frame;
    }
  }
}

// [m] between two cubes, by their faces alone; below zero they overlap.
double Apart(const Body& a, const Body& b, double half) {
  const Matrix3 axes[2] = {a.rotation_WB.toRotationMatrix(), b.rotation_WB.toRotationMatrix()};
  const Vector3 between = b.position_W - a.position_W;
  double apart = -INFINITY;
  for (const Matrix3& faces : axes)
    for (int k = 0; k < 3; ++k) {
      const Vector3 n = faces.col(k);
      const double reach =
          half * ((axes[0].transpose() * n).cwiseAbs().sum() + (axes[1].transpose() * n).cwiseAbs().sum());
      apart = std::max(apart, std::abs(n.dot(between)) - reach);
    }
  return apart;
}

// What comes in a crowd's piece rebounds by the speed that it had then: weight that acts on for the rest of the piece once gave balls that
// are dropped 9 % too much energy.
TEST(Crowd, BallsThatAreDroppedReboundByTheirRestitution) {
  constexpr double kHeight = 0.5;
  for (const double e : {0.5, 0.9, 1.0}) {
    for (const double dt : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
      World world(Awake());
      world.Add(Floor(0, e));
      for (int k = 0; k < 25; ++k) world.Add(Ball({0.2 * (k % 5), 0.2 * (k / 5), 0.1 + kHeight}, 0.1, 0, e));
      double energy = 0;
      for (double t = 0; energy == 0 && t < 0.4; t += dt) {
        EXPECT_FALSE(world.Step(dt).Failed());
        const Body& ball = world.body(1);
        if (ball.linear_velocity_W.z() > 0)
          energy = 0.5 * ball.linear_velocity_W.squaredNorm() + kGravity * (ball.position_W.z() - 0.1);
      }
      EXPECT_NEAR(energy / (kGravity * kHeight), e * e, 1e-6) << e << " " << dt;
    }
  }
}

// Newton's cradle of more than 20: as many leave as came, as fast. They rebound by the speed at which they came, to the last bit: one that
// what was carried and taken back had rounded up made more energy than a blow may, and all ended as one.
TEST(Crowd, AsManyLeaveALongCradleAsCame) {
  for (const auto& [row, hitting] : {std::pair{19, 2}, {19, 3}, {15, 8}, {25, 3}}) {
    for (const bool boxes : {false, true}) {
      World world(Awake());
      world.Add(Floor(0, 0));
      const auto add = [&](double x, double speed) {
        BodyDefinition body = Ball({x, 0, 0.1}, 0.1, 0, 1);
        if (boxes) body.shape = Shape::Box({0.1, 0.1, 0.1});
        body.mass = 1;
        body.linear_velocity_W.x() = speed;
        world.Add(body);
      };
      for (int k = 0; k < row; ++k) add(0.2 * k, 0);
      for (int k = 0; k < hitting; ++k) add(-0.5 - 0.2 * k, 2);
      for (int i = 0; i < 30; ++i) EXPECT_FALSE(world.Step(1.0 / 60).Failed());
      for (int k = 0; k < row; ++k)
        EXPECT_NEAR(world.body(1 + k).linear_velocity_W.x(), k >= row - hitting ? 2 : 0, 1e-4) << row << hitting << k;
    }
  }
}

// A blow that runs down a row of cubes which rest apart: all whom it may reach within the step belong to the crowd. Once those beyond the
// first few did not, and the crowd's cubes moved into them, unseen.
TEST(Crowd, BlowDownARowReachesNobodyOutside) {
  World world(ByLaw());
  world.Add(Floor(0.2, 0.1));
  constexpr int kCubes = 30;
  for (int i = 0; i < kCubes; ++i) {
    BodyDefinition cube = Cube({0.53 * i, 0, 0.25}, 0.2, 0.2);
    cube.shape = Shape::Box({0.25, 0.25, 0.25});
    world.Add(cube);
  }
  BodyDefinition block = Cube({-1.5, 0, 0.5}, 0, 0.2);
  block.mass = 200;
  block.linear_velocity_W = {5, 0, 0};
  world.Add(block);
  for (int frame = 0; frame < 90; ++frame) {
    EXPECT_FALSE(world.Step(1.0 / 60).Failed()) << frame;
    for (int i = 1; i < kCubes; ++i) {
      EXPECT_GT(Apart(world.body(i), world.body(i + 1), 0.25), -1e-3) << i << " at " << frame;
    }
  }
}

// A ram that leaves 15 cm squeezes balls of 24 cm against the wall. No velocity keeps them apart: contacts give way, which the report
// says, and nobody is shot through a wall. (What is squeezed out may be fast: of 16 starts that differ by 1e-4 m ten exceed 20 m/s.)
TEST(Crowd, RamSqueezesBallsThatGiveWay) {
  World world(ByLaw());
  world.Add(Floor());
  AddWalls(&world, 1.5, 2, 2);
  for (int i = 0; i < 30; ++i)
    world.Add(Ball({0.3 + 0.25 * (i % 3), -0.75 + 0.25 * (i / 3 % 5), 0.15 + 0.25 * (i / 15)}, 0.12, 0.5, 0.5));
  BodyDefinition ram{.shape = Shape::Box({0.3, 0.95, 0.3}), .kind = BodyKind::kKinematic};
  ram.position_W = {-0.65, 0, 0.35};
  const int number = world.Add(ram);
  bool told = false;
  for (int frame = 0; frame < 155; ++frame) {
    world.SetVelocity(number, {world.body(number).position_W.x() < 0.55 ? 0.5 : 0, 0, 0}, Vector3::Zero());
    const StepReport report = world.Step(1.0 / 60);
    told = told || report.overlapping > 0;
    EXPECT_EQ(report.unstepped, 0) << frame;
    EXPECT_EQ(report.ledger.sides_changed, 0) << frame;
    for (const Body& body : world.bodies()) EXPECT_LE(body.linear_velocity_W.norm(), 200) << frame;
  }
  EXPECT_TRUE(told);
}

}  // namespace
}  // namespace islet
