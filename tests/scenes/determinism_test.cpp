// The same bits on any number of threads.
#include <algorithm>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/scene.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

std::vector<std::uint64_t> Hashes(const std::string& scene, int count, int frames, Settings settings, int threads) {
  settings.threads = threads;
  BuiltScene built = BuildScene(*FindScene(scene), {.count = count}, settings);
  std::vector<std::uint64_t> hashes;
  for (int i = 0; i < frames; ++i) {
    testing::Step(&built.world, 1.0 / 30);
    hashes.push_back(built.world.StateHash());
  }
  return hashes;
}

void ExpectSameOnAnyNumberOfThreads(const std::string& scene, int count, int frames, const Settings& settings) {
  const std::vector<std::uint64_t> one = Hashes(scene, count, frames, settings, 1);
  for (const int threads : {2, 4, 8}) {
    const std::vector<std::uint64_t> many = Hashes(scene, count, frames, settings, threads);
    const auto first = std::mismatch(one.begin(), one.end(), many.begin());
    EXPECT_EQ(first.first, one.end()) << threads << " threads differ from frame " << first.first - one.begin();
  }
}

TEST(Determinism, Hourglass) { ExpectSameOnAnyNumberOfThreads("cubeglass", 100, 150, {}); }
TEST(Determinism, Cubejam) { ExpectSameOnAnyNumberOfThreads("cubejam", 100, 120, {}); }
TEST(Determinism, HourglassLikeThePaper) { ExpectSameOnAnyNumberOfThreads("cubeglass", 100, 150, Settings::Paper()); }
TEST(Determinism, CubejamLikeThePaper) { ExpectSameOnAnyNumberOfThreads("cubejam", 100, 120, Settings::Paper()); }
TEST(Determinism, ManyStacks) { ExpectSameOnAnyNumberOfThreads("manystacks", 20, 30, {}); }

TEST(Determinism, RunsRepeat) { EXPECT_EQ(Hashes("cubejam", 40, 90, {}, 2), Hashes("cubejam", 40, 90, {}, 2)); }

// Velocities after one step of a pyramid, its bodies added in a shuffled order, in the order of `definitions`.
std::vector<Body> StepShuffled(const std::vector<BodyDefinition>& definitions, unsigned shuffle, Model model) {
  std::vector<size_t> order(definitions.size());
  std::iota(order.begin(), order.end(), 0);
  std::mt19937 rng(shuffle);
  if (shuffle > 0) std::shuffle(order.begin(), order.end(), rng);
  Settings settings;
  settings.threads = 1;
  settings.model = model;
  settings.bounce_limit = 0;
  World world(settings);
  for (const size_t i : order) world.Add(definitions[i]);
  testing::Step(&world, 1.0 / 60);
  std::vector<Body> bodies(definitions.size());
  for (size_t place = 0; place < order.size(); ++place) bodies[order[place]] = world.bodies()[place];
  return bodies;
}

void ExpectOrderDoesNotMatter(const std::vector<BodyDefinition>& definitions, Model model, double tolerance) {
  const std::vector<Body> first = StepShuffled(definitions, 0, model);
  for (unsigned shuffle = 1; shuffle < 6; ++shuffle) {
    const std::vector<Body> bodies = StepShuffled(definitions, shuffle, model);
    for (size_t i = 0; i < bodies.size(); ++i) {
      EXPECT_LT((bodies[i].linear_velocity_W - first[i].linear_velocity_W).norm(), tolerance) << shuffle << " " << i;
      EXPECT_LT((bodies[i].angular_velocity_W - first[i].angular_velocity_W).norm(), 2 * tolerance)
          << shuffle << " " << i;
    }
  }
}

// The convex optimum is unique in the velocities. Exact Coulomb friction is only where nothing slides: a pyramid in which
// bodies slide has several answers, up to centimetres a second apart, and the order decides between them.
TEST(Determinism, OrderOfInsertionChangesVelocitiesByToleranceOnly) {
  std::vector<BodyDefinition> pyramid{testing::Floor()};
  for (int row = 0; row < 5; ++row)
    for (int i = 0; i < 5 - row; ++i) pyramid.push_back(testing::Cube({1.02 * i + 0.51 * row, 0.03 * i, row + 0.5}));
  ExpectOrderDoesNotMatter(pyramid, Model::kCoulomb, 1e-6);
  pyramid.back().linear_velocity_W = {1.5, 0.2, 0};
  pyramid[1].linear_velocity_W = {-1, 0, 0};
  ExpectOrderDoesNotMatter(pyramid, Model::kConvex, 1e-5);
}

}  // namespace
}  // namespace islet
