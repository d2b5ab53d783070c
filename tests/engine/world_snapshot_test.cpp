#include "engine/world_snapshot.h"

#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

using testing::Ball;
using testing::Cube;
using testing::Floor;
using testing::StepTimes;

constexpr double kDt = 1.0 / 60;

Settings Threads(int threads, Freezing freezing = Freezing::kCertified) {
  Settings settings;
  settings.threads = threads;
  settings.freezing = freezing;
  return settings;
}

// Three stacks that a ball is about to hit.
World Scene(const Settings& settings) {
  World world(settings);
  world.Add(Floor());
  for (int stack = 0; stack < 3; ++stack)
    for (int i = 0; i < 4; ++i) world.Add(Cube({1.2 * stack, 0.05 * i, i + 0.5}, 0.5, 0.2));
  BodyDefinition ball = Ball({-3, 0.1, 2.2}, 0.5, 0.5, 0.5);
  ball.mass = 3;
  ball.linear_velocity_W = {8, 0, 0};
  world.Add(ball);
  return world;
}

std::vector<std::uint64_t> Hashes(World* world, int frames) {
  std::vector<std::uint64_t> hashes;
  for (int i = 0; i < frames; ++i) {
    testing::Step(world, kDt);
    hashes.push_back(world->StateHash());
  }
  return hashes;
}

TEST(WorldSnapshot, ContinuesBitForBitFromAnyFrame) {
  for (const Freezing freezing : {Freezing::kOff, Freezing::kCertified, Freezing::kPaper}) {
    World world = Scene(Threads(1, freezing));
    std::vector<WorldSnapshot> snapshots;
    std::vector<std::uint64_t> hashes;
    for (int frame = 0; frame < 180; ++frame) {
      if (frame % 9 == 0) snapshots.push_back(world.Save());
      hashes.push_back(Hashes(&world, 1)[0]);
    }
    for (size_t i = 0; i < snapshots.size(); ++i) {
      World other(Threads(i % 2 ? 1 : 2, freezing));
      other.Restore(snapshots[i]);
      for (size_t frame = 9 * i; frame < hashes.size() && frame < 9 * i + 30; ++frame) {
        testing::Step(&other, kDt);
        ASSERT_EQ(other.StateHash(), hashes[frame]) << "from frame " << 9 * i << ", frame " << frame;
      }
    }
  }
}

TEST(WorldSnapshot, GoesBackInTheSameWorld) {
  World world = Scene(Threads(1));
  StepTimes(&world, 25);
  const WorldSnapshot snapshot = world.Save();
  const double time = world.time();
  const std::vector<std::uint64_t> first = Hashes(&world, 60);
  world.Remove(3);  // what happens after it must not show
  world.SetGravity({1, 2, -3});
  StepTimes(&world, 10);
  world.Restore(snapshot);
  EXPECT_EQ(world.time(), time);
  EXPECT_EQ(world.settings().gravity, Vector3(0, 0, -9.81));
  EXPECT_EQ(Hashes(&world, 60), first);
}

// Impulses and contacts of the last step belong to the state: what reads loads finds them.
TEST(WorldSnapshot, KeepsImpulsesAndContacts) {
  World world = Scene(Threads(1));
  StepTimes(&world, 10);
  World other(Threads(1));
  other.Restore(world.Save());
  ASSERT_EQ(other.impulses().size(), world.impulses().size());
  ASSERT_EQ(other.resolved_contacts().size(), world.resolved_contacts().size());
  EXPECT_EQ(other.contacts().size(), world.contacts().size());
  for (size_t c = 0; c < world.impulses().size(); ++c) EXPECT_EQ(other.impulses()[c], world.impulses()[c]);
  EXPECT_EQ(testing::ImpulseOn(other, 0), testing::ImpulseOn(world, 0));
}

TEST(WorldSnapshot, OutlivesItsWorldAndServesMany) {
  std::optional<World> world(Scene(Threads(1)));
  StepTimes(&*world, 20);
  const WorldSnapshot snapshot = world->Save();
  const std::vector<std::uint64_t> hashes = Hashes(&*world, 20);
  world.reset();
  for (int i = 0; i < 2; ++i) {
    World other(Threads(1));
    other.Restore(snapshot);
    EXPECT_EQ(Hashes(&other, 20), hashes);
  }
}

// Bodies that were added and not stepped yet are checked for overlap after a restore, as they would have been.
TEST(WorldSnapshot, StillChecksBodiesThatWereJustAdded) {
  World world = Scene(Threads(1));
  StepTimes(&world, 5);
  world.Add(Cube({0, 0, 0.6}));
  World other(Threads(1));
  other.Restore(world.Save());
  EXPECT_THROW(testing::Step(&other, kDt), std::invalid_argument);
}

}  // namespace
}  // namespace islet
