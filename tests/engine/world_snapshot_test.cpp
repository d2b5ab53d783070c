#include "engine/world_snapshot.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
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

// What is restored frozen where nothing freezes would never wake: it moves.
TEST(WorldSnapshot, WakesWhereNothingFreezes) {
  for (const int group_bodies : {0, 20}) {
    Settings settings = Threads(1);
    settings.group_bodies = group_bodies;
    World world(settings);
    const int floor = world.Add(Floor());
    const int cube = world.Add(Cube({0, 0, 0.5}));
    StepTimes(&world, 60, kDt);
    ASSERT_TRUE(world.body(cube).frozen);
    settings.freezing = Freezing::kOff;
    World other(settings);
    other.Restore(world.Save());
    other.Remove(floor);
    StepTimes(&other, 60, kDt);
    EXPECT_NEAR(other.body(cube).position_W.z(), 0.5 - 0.5 * testing::kGravity, 1e-9) << group_bodies;
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

// A pile of everything: hulls, frozen bodies, a removed one, pairs set apart, a sensor; moved as groups or as a crowd.
World Pile(const Settings& settings) {
  World world(settings);
  world.Add(testing::Floor());
  for (int i = 0; i < 12; ++i) world.Add(testing::Cube({1.3 * (i % 3), 1.3 * (i / 3 % 2), 0.6 + 1.2 * (i / 6)}));
  world.Add({.shape = Shape::ConvexHull(std::vector<Vector3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}}),
             .position_W = {0.5, 0.5, 4},
             .angular_velocity_W = {1, 2, 3}});
  world.Add(testing::Ball({1, 0.4, 6}));
  world.Add({.shape = Shape::Box({9, 9, 0.1}), .kind = BodyKind::kFixed, .position_W = {0, 0, 3}, .sensor = true});
  world.SetCollision(1, 2, false);
  world.Remove(7);
  return world;
}

TEST(WorldSnapshot, BytesGoOnBitForBit) {
  for (const bool crowd : {false, true}) {
    const Settings settings = crowd ? testing::AsCrowd(Threads(1)) : Threads(1);
    World world = Pile(settings);
    for (const int frames : {0, 1, 25, 60, 100}) {
      StepTimes(&world, frames);
      const std::vector<std::byte> bytes = world.Save().ToBytes();
      World other(settings);
      other.Restore(WorldSnapshot::FromBytes(bytes));
      EXPECT_EQ(other.Save().ToBytes(), bytes);
      EXPECT_EQ(other.StateHash(), world.StateHash());
      World twin(settings);
      twin.Restore(world.Save());
      EXPECT_EQ(Hashes(&other, 40), Hashes(&twin, 40)) << crowd << ", after " << frames;
      EXPECT_EQ(other.time(), twin.time());
      EXPECT_EQ(other.events().size(), twin.events().size());
    }
  }
}

std::string RefusalOf(const std::vector<std::byte>& bytes) {
  try {
    WorldSnapshot::FromBytes(bytes);
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

TEST(WorldSnapshot, DamagedBytesAreRefused) {
  World world(Threads(1));
  world.Add(testing::Floor());
  world.Add(testing::Cube({0, 0, 0.5}));
  StepTimes(&world, 20);
  const std::vector<std::byte> bytes = world.Save().ToBytes();
  ASSERT_EQ(RefusalOf(bytes), "");
  for (size_t length = 0; length < bytes.size(); length += 1 + length / 7)
    EXPECT_NE(RefusalOf({bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length)}), "") << length;
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::vector<std::byte> flipped = bytes;
    flipped[bit / 8] ^= std::byte{1} << bit % 8;
    ASSERT_NE(RefusalOf(flipped), "") << "bit " << bit;
  }
  std::vector<std::byte> longer = bytes, other = bytes, alien = bytes;
  longer.push_back(std::byte{0});
  EXPECT_NE(RefusalOf(longer).find("header"), std::string::npos);
  other[8] = std::byte{99};
  EXPECT_NE(RefusalOf(other).find("version 99"), std::string::npos);
  alien[0] = std::byte{'x'};
  EXPECT_NE(RefusalOf(alien).find("none of islet's"), std::string::npos);
}

// A made-up snapshot whose checksum is right: a box with an edge to a ninth corner would be read past the end of its corners.
TEST(WorldSnapshot, MadeUpPolytopesAreRefused) {
  World world(Threads(1));
  world.Add(Cube({0, 0, 1}));
  std::vector<std::byte> bytes = world.Save().ToBytes();
  constexpr size_t kHead = 32;  // magic, version, length, checksum
  const auto number = [&](size_t at, size_t size) {
    std::uint64_t value = 0;
    std::memcpy(&value, &bytes[at], size);
    return value;
  };
  size_t edges = kHead;
  const auto is_edges = [&](size_t at) {
    if (number(at, 8) != 12) return false;
    for (size_t k = 0; k < 24; ++k)
      if (number(at + 8 + 4 * k, 4) > 7) return false;
    return true;
  };
  while (edges + 8 + 96 < bytes.size() && !is_edges(edges)) ++edges;
  ASSERT_LT(edges + 8 + 96, bytes.size());
  bytes[edges + 8] = std::byte{8};
  std::uint64_t state = 0x243f6a8885a308d3u;
  for (size_t i = kHead; i < bytes.size(); i += 8) {
    state = (state ^ number(i, std::min<size_t>(8, bytes.size() - i))) * 0x9e3779b97f4a7c15u;
    state ^= state >> 32;
  }
  std::memcpy(&bytes[kHead - 8], &state, 8);
  EXPECT_EQ(RefusalOf(bytes), "snapshot: an edge has no such vertex");
}

// With nothing but poses and velocities a world of the same bodies goes on as the first one did, from any frame.
TEST(WorldSnapshot, StatelessWorldsRollBack) {
  for (const bool crowd : {false, true}) {
    Settings settings = crowd ? testing::AsCrowd(Threads(1)) : Threads(1);
    settings.stateless = true;
    World world = Pile(settings);
    std::vector<std::vector<std::byte>> motions;
    std::vector<std::uint64_t> hashes;
    for (int i = 0; i < 60; ++i) {
      motions.push_back(world.SaveMotion());
      testing::Step(&world, kDt);
      hashes.push_back(world.StateHash());
    }
    EXPECT_EQ(motions[0].size(), 104 * world.bodies().size());
    World other = Pile(settings);
    for (const size_t from : {50u, 3u, 29u}) {
      other.RestoreMotion(motions[from]);
      for (size_t i = from; i < 60; ++i) {
        testing::Step(&other, kDt);
        ASSERT_EQ(other.StateHash(), hashes[i]) << crowd << ", from " << from << ", frame " << i;
      }
    }
    for (int i = 0; i < 30; ++i) {  // the same step twice, of any length: nothing of the one before is left
      const std::vector<std::byte> motion = other.SaveMotion();
      const double dt = i % 3 == 0 ? 0.1 : i % 3 == 1 ? 1e-4 : kDt;
      other.Step(dt);
      const std::uint64_t once = other.StateHash();
      other.RestoreMotion(motion);
      other.Step(dt);
      ASSERT_EQ(other.StateHash(), once) << crowd << ' ' << i;
    }
    motions[0].pop_back();
    EXPECT_THROW(other.RestoreMotion(motions[0]), std::invalid_argument);
    std::memset(motions[1].data(), 0xff, 8);  // NaN
    const std::uint64_t hash = other.StateHash();
    EXPECT_THROW(other.RestoreMotion(motions[1]), std::invalid_argument);
    EXPECT_EQ(other.StateHash(), hash);
  }
}

}  // namespace
}  // namespace islet
