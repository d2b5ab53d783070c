// What is symmetric about a plane stays so through whole steps, and is what it is without the rung that makes use of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Cube;
using testing::Floor;
using testing::Turn;

constexpr double kStep = 1.0 / 60;

// As a crowd, which asks for each step's problem anew; a small group has few of them.
Settings Awake(bool planar, bool columns = false, bool crowd = true) {
  Settings settings = crowd ? testing::AsCrowd(testing::Awake()) : testing::Awake();
  if (!columns) settings.ladder = settings.ladder.Without(qp::Rung::kColumn);
  if (!planar) settings.ladder = settings.ladder.Without(qp::Rung::kPlanar);
  return settings;
}

// Cubes over each other, 0.1 m apart, each moving by `push` times its number along one of its sides; all turned about z.
World Dropped(const Settings& settings, int count, double restitution, double push, double turned) {
  World world(settings);
  world.Add(Floor(0.5, restitution));
  for (int i = 0; i < count; ++i) {
    BodyDefinition cube = Cube({0.3, -0.2, 0.6 + 1.1 * i}, 0.5, restitution);
    cube.rotation_WB = Turn(turned, Vector3::UnitZ());
    cube.linear_velocity_W = cube.rotation_WB * Vector3(push * i, 0, 0);
    world.Add(cube);
  }
  return world;
}

struct Watched {
  std::int64_t planar = 0, columns = 0, others = 0;
  double out = 0;  // largest distance from the plane [m], or spin [rad/s] or velocity [m/s] out of it
};

Watched StepAndWatch(World* world, int frames, double turned) {
  Watched run;
  const Vector3 e = Turn(turned, Vector3::UnitZ()) * Vector3::UnitY();
  for (int frame = 0; frame < frames; ++frame) {
    const StepReport report = world->Step(kStep);
    run.planar += report.ladder.rungs[static_cast<int>(qp::Rung::kPlanar)].problems;
    run.columns += report.ladder.rungs[static_cast<int>(qp::Rung::kColumn)].problems;
    run.others += report.ladder.rungs[static_cast<int>(qp::Rung::kSweeps)].problems +
                  report.ladder.rungs[static_cast<int>(qp::Rung::kNewton)].problems +
                  report.ladder.rungs[static_cast<int>(qp::Rung::kInteriorPoint)].problems;
    EXPECT_EQ(report.collision_qp.failed + report.static_qp.failed, 0);
    EXPECT_LT(report.certificate.momentum, 1e-9);
    EXPECT_LT(report.certificate.dual, 2e-6);
    for (const Body& body : world->bodies()) {
      if (!body.Moves()) continue;
      const Vector3& w = body.angular_velocity_W;
      run.out = std::max({run.out, std::abs(e.dot(body.position_W - Vector3(0.3, -0.2, 0))),
                          std::abs(e.dot(body.linear_velocity_W)), (w - e.dot(w) * e).norm()});
    }
  }
  return run;
}

TEST(Planar, DroppedStacksStayInTheirPlane) {
  for (const double turned : {0.0, 0.4}) {
    for (const double restitution : {0.0, 0.5}) {
      for (const double push : {0.0, 0.05}) {
        if (restitution > 0 && push > 0) continue;  // bounces on two corners, one at a time, break the symmetry
        SCOPED_TRACE(::testing::Message() << turned << " " << restitution << " " << push);
        for (const bool columns : {false, true}) {
          World world = Dropped(Awake(true, columns), 4, restitution, push, turned);
          const Watched run = StepAndWatch(&world, 90, turned);
          EXPECT_LT(run.out, 1e-9) << columns;
          EXPECT_EQ(run.others, 0) << columns;
          if (columns) {
            EXPECT_GT(run.columns, push == 0 ? 4 : -1);
          } else {
            EXPECT_GT(run.planar, 4);
          }
          World group = Dropped(Awake(true, columns, false), 4, restitution, push, turned);
          const Watched grouped = StepAndWatch(&group, 90, turned);
          EXPECT_LT(grouped.out, 1e-9) << columns;
          EXPECT_EQ(grouped.others, 0) << columns;
        }
      }
    }
  }
}

TEST(Planar, DroppedStacksEndWhereTheyDoWithoutTheRung) {
  World with = Dropped(Awake(true), 4, 0, 0.02, 0.4), without = Dropped(Awake(false), 4, 0, 0.02, 0.4);
  const Watched flat = StepAndWatch(&with, 90, 0.4), whole = StepAndWatch(&without, 90, 0.4);
  EXPECT_GT(flat.planar, 4);
  EXPECT_EQ(whole.planar, 0);
  for (int i = 1; i <= 4; ++i) {
    const Body &a = with.body(i), &b = without.body(i);
    EXPECT_LT((a.position_W - b.position_W).norm(), 1e-4) << i;
    EXPECT_LT(a.rotation_WB.angularDistance(b.rotation_WB), 1e-4) << i;
    EXPECT_LT((a.linear_velocity_W - b.linear_velocity_W).norm(), 1e-4) << i;
  }
}

// A cube turned a little among the others: nothing is symmetric any more once it has landed.
TEST(Planar, OneTurnedCubeBreaksTheSymmetry) {
  World world = Dropped(Awake(true), 3, 0, 0, 0);
  BodyDefinition cube = Cube({0.3, -0.2, 3.9});
  cube.rotation_WB = Turn(0.2, Vector3(0.1, 0.2, 1));
  world.Add(cube);
  const Watched run = StepAndWatch(&world, 60, 0);
  EXPECT_GT(run.others, 5);
}

}  // namespace
}  // namespace islet
