#include "scenes/film/film.h"

#include <gtest/gtest.h>

namespace islet {
namespace {

// Bodies 1 and 3 stand on each other, 2 apart, all on the floor 0; 4 is in the air.
World Piles() {
  Settings settings;
  settings.threads = 1;
  settings.freezing = Freezing::kOff;
  World world(settings);
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed});
  world.Add({.shape = cube, .position_W = {0, 0, 0.5}});
  world.Add({.shape = cube, .position_W = {5, 0, 0.5}});
  world.Add({.shape = cube, .position_W = {0, 0, 1.5}});
  world.Add({.shape = cube, .position_W = {9, 0, 9}, .linear_velocity_W = {2, 0, 0}});
  return world;
}

TEST(Film, IslandsAreNamedByTheirSmallestBody) {
  World world = Piles();
  const double start = PotentialEnergy(world);
  const StepReport report = world.Step(1.0 / 60);
  const FilmFrame frame = FrameOf(world, report, 1, 0, start);
  EXPECT_EQ(frame.island, (std::vector<int>{-1, 1, 2, 1, 4}));
  EXPECT_FALSE(frame.contacts.empty());
  EXPECT_EQ(frame.accuracy[1], frame.accuracy[3]);
}

TEST(Film, FrameZeroTellsWhoIsAwakeAndHowFast) {
  const World world = Piles();
  const FilmFrame frame = FrameOf(world, {}, 0, 0, PotentialEnergy(world));
  EXPECT_EQ(frame.numbers.awake, 4);
  EXPECT_EQ(frame.numbers.frozen, 0);
  EXPECT_DOUBLE_EQ(frame.numbers.kinetic, 0.5 * world.body(4).mass * 4);
  EXPECT_EQ(frame.numbers.potential, 0);
}

}  // namespace
}  // namespace islet
