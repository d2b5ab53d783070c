// Islands next to frozen bodies are drafted until it is known which of those wake, then certified.
#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Cube;
using testing::Floor;

constexpr double kStep = 1.0 / 60;

// A layer of 49 cubes, side by side with gaps, at rest and frozen; then 49 more fall on it, turned.
World FrozenLayer(Settings settings = {}) {
  World world(settings);
  world.Add(Floor());
  for (int i = 0; i < 49; ++i) world.Add(Cube({1.05 * (i % 7), 1.05 * (i / 7), 0.5}));
  for (int frame = 0; frame < 60; ++frame) testing::Step(&world, kStep);
  for (int i = 0; i < 49; ++i) {
    BodyDefinition cube = Cube({1.05 * (i % 7) + 0.3, 1.05 * (i / 7) + 0.2, 2 + 1.8 * ((i + i / 7) % 2) + 0.01 * i});
    cube.rotation_WB = testing::Turn(0.1 + 0.02 * i, Vector3(1, 0.3 * i, 0.5));
    cube.linear_velocity_W = {0, 0, -3};
    world.Add(cube);
  }
  return world;
}

TEST(Drafts, EveryAnswerThatIsReportedIsCertified) {
  World world = FrozenLayer();
  for (int i = 1; i <= 49; ++i) ASSERT_TRUE(world.body(i).frozen) << i;
  int drafts = 0, woken = 0;
  for (int frame = 0; frame < 90; ++frame) {
    const StepReport report = testing::Step(&world, kStep);
    drafts += report.collision_qp.drafts + report.static_qp.drafts;
    woken += report.woken;
    EXPECT_EQ(report.collision_qp.failed + report.static_qp.failed, 0) << frame;
    EXPECT_LT(report.certificate.dual, 2e-6) << frame;
    EXPECT_LT(report.certificate.gap, 2e-6) << frame;
    EXPECT_LT(report.frozen_imbalance, 1e-3) << frame;
    std::set<int> names;
    int contacts = 0;
    for (const IslandReport& island : report.islands) {
      EXPECT_TRUE(names.insert(island.first_body).second) << frame << " " << island.first_body;
      contacts += island.contacts;
    }
    EXPECT_EQ(contacts, report.active_contacts) << frame;
  }
  EXPECT_GT(drafts, 0);
  EXPECT_GT(woken, 10);
}

// Drafts are sweeps, too.
TEST(Drafts, NoneWithoutSweeps) {
  Settings settings;
  settings.ladder = settings.ladder.Without(qp::Rung::kSweeps);
  World world = FrozenLayer(settings);
  int woken = 0;
  for (int frame = 0; frame < 90; ++frame) {
    const StepReport report = testing::Step(&world, kStep);
    woken += report.woken;
    EXPECT_EQ(report.collision_qp.drafts + report.static_qp.drafts, 0) << frame;
    EXPECT_EQ(report.ladder.rungs[static_cast<int>(qp::Rung::kSweeps)].problems, 0) << frame;
  }
  EXPECT_GT(woken, 10);
}

// A worker that has drafted an island may be the one that balances frozen bodies next: to the tolerance, like any other.
TEST(Drafts, SameBitsOnAnyNumberOfThreads) {
  std::vector<World> worlds;
  for (const int threads : {1, 2, 3}) {
    Settings settings;
    settings.threads = threads;
    worlds.push_back(FrozenLayer(settings));
  }
  for (int frame = 0; frame < 150; ++frame) {
    for (World& world : worlds) testing::Step(&world, kStep);
    ASSERT_EQ(worlds[1].StateHash(), worlds[0].StateHash()) << frame;
    ASSERT_EQ(worlds[2].StateHash(), worlds[0].StateHash()) << frame;
  }
}

TEST(Drafts, NoneWithoutFrozenBodiesOrInTheSweptTier) {
  Settings off, swept;
  off.freezing = Freezing::kOff;
  swept.tier = Tier::kSwept;
  for (const Settings& settings : {off, swept}) {
    World world = FrozenLayer(settings);
    for (int frame = 0; frame < 40; ++frame) {
      const StepReport report = testing::Step(&world, kStep);
      EXPECT_EQ(report.collision_qp.drafts + report.static_qp.drafts, 0) << frame;
    }
  }
}

}  // namespace
}  // namespace islet
