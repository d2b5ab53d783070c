#include "islands/freezing.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace islet::islands {
namespace {

// One body through a story of frames; each letter: s still and touching, f too fast, a in the air, w outside.
// Returns the number of the frame in which it froze, from 1, or 0.
int FrozenInFrame(const char* story, int freeze_count) {
  std::vector<int> counters(1, 0);
  std::vector<std::uint8_t> frozen(1, 0);
  int frame = 0;
  for (const char* f = story; *f; ++f) {
    ++frame;
    const std::vector<double> energy{*f == 'f' ? 1.0 : 0.4}, threshold{0.5};
    const std::vector<std::uint8_t> touches{static_cast<std::uint8_t>(*f != 'a')},
        may{static_cast<std::uint8_t>(*f != 'w')};
    UpdateFreezing({energy, threshold, touches, may}, freeze_count, counters, frozen);
    if (frozen[0]) return frame;
  }
  return 0;
}

TEST(UpdateFreezing, FreezesWhenTheCounterExceedsTheLimit) {
  EXPECT_EQ(FrozenInFrame("ssss", 0), 1);
  EXPECT_EQ(FrozenInFrame("ssss", 1), 2);
  EXPECT_EQ(FrozenInFrame("ssss", 3), 4);
  EXPECT_EQ(FrozenInFrame("sss", 3), 0);
}

TEST(UpdateFreezing, AnyInterruptionStartsAgain) {
  for (const char* story : {"sssfssss", "sssassss", "ssswssss"}) EXPECT_EQ(FrozenInFrame(story, 3), 8) << story;
  EXPECT_EQ(FrozenInFrame("sfsfsfsf", 1), 0);
}

TEST(UpdateFreezing, EnergyAtTheThresholdIsNotStill) {
  std::vector<int> counters(1, 5);
  std::vector<std::uint8_t> frozen(1, 0);
  const std::vector<double> energy{0.5}, threshold{0.5};
  const std::vector<std::uint8_t> yes{1};
  UpdateFreezing({energy, threshold, yes, yes}, 1, counters, frozen);
  EXPECT_EQ(frozen[0], 0);
  EXPECT_EQ(counters[0], 0);
}

TEST(UpdateFreezing, LeavesFrozenBodiesAlone) {
  std::vector<int> counters{7, 7};
  std::vector<std::uint8_t> frozen{1, 0};
  const std::vector<double> energy{9, 9}, threshold{1, 1};
  const std::vector<std::uint8_t> no{0, 0};
  UpdateFreezing({energy, threshold, no, no}, 1, counters, frozen);
  EXPECT_EQ(frozen, (std::vector<std::uint8_t>{1, 0}));
  EXPECT_EQ(counters, (std::vector<int>{7, 0}));
}

// Many bodies at once behave as each would alone.
TEST(UpdateFreezing, BodiesAreIndependent) {
  std::mt19937 rng(1);
  std::bernoulli_distribution mostly(0.8);
  const size_t n = 50;
  std::vector<int> counters(n, 0), alone(n, 0);
  std::vector<std::uint8_t> frozen(n, 0), frozen_alone(n, 0);
  for (int frame = 0; frame < 40; ++frame) {
    std::vector<double> energy(n), threshold(n, 1);
    std::vector<std::uint8_t> touches(n), may(n);
    for (size_t i = 0; i < n; ++i) {
      energy[i] = mostly(rng) ? 0.5 : 2;
      touches[i] = mostly(rng);
      may[i] = mostly(rng);
      if (frozen_alone[i]) continue;
      alone[i] = energy[i] < 1 && touches[i] && may[i] ? alone[i] + 1 : 0;
      if (alone[i] > 3) frozen_alone[i] = 1;
    }
    UpdateFreezing({energy, threshold, touches, may}, 3, counters, frozen);
    EXPECT_EQ(frozen, frozen_alone);
    EXPECT_EQ(counters, alone);
  }
}

}  // namespace
}  // namespace islet::islands
