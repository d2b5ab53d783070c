#include "engine/impact/contact_queue.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/no_alloc.h"

namespace islet {
namespace {

int FirstOf(const std::vector<double>& keys) {  // std::min_element: the first of equal ones
  return static_cast<int>(std::min_element(keys.begin(), keys.end()) - keys.begin());
}

TEST(ContactQueue, FastestApproachFirst) {
  ContactQueue queue;
  EXPECT_TRUE(queue.empty());
  queue.Assign(std::vector<double>{1, -3, 2, -5});
  EXPECT_EQ(queue.top(), 3);
  EXPECT_EQ(queue.top_key(), -5);
  queue.Update(3, 4);
  EXPECT_EQ(queue.top(), 1);
  queue.Update(2, -7);
  EXPECT_EQ(queue.top(), 2);
}

TEST(ContactQueue, TiesGoToTheSmallestNumberWhateverHappenedBefore) {
  ContactQueue queue;
  queue.Assign(std::vector<double>{0, -1, -1, -1});
  EXPECT_EQ(queue.top(), 1);
  queue.Update(1, -2), queue.Update(1, -1);
  EXPECT_EQ(queue.top(), 1);
  queue.Update(0, -1);
  EXPECT_EQ(queue.top(), 0);
  queue.Update(0, -0.0), queue.Update(1, 0.0), queue.Update(2, 0.0), queue.Update(3, -0.0);  // equal zeros
  EXPECT_EQ(queue.top(), 0);
}

TEST(ContactQueue, DrainsInTheOrderOfASort) {
  std::mt19937 rng(1);
  for (const int n : {1, 2, 3, 10, 257}) {
    std::uniform_int_distribution<int> few(-5, 5);  // many ties
    std::vector<double> keys(n);
    for (double& key : keys) key = few(rng);
    std::vector<int> expected(n);
    std::iota(expected.begin(), expected.end(), 0);
    std::stable_sort(expected.begin(), expected.end(), [&](int a, int b) { return keys[a] < keys[b]; });
    ContactQueue queue;
    queue.Assign(keys);
    for (const int contact : expected) {
      ASSERT_EQ(queue.top(), contact);
      queue.Update(contact, std::numeric_limits<double>::infinity());
    }
  }
}

TEST(ContactQueue, RandomUpdatesAgreeWithASearch) {
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::uniform_int_distribution<int> coarse(-3, 3);
  std::vector<double> keys(100);
  for (double& key : keys) key = uniform(rng);
  ContactQueue queue;
  queue.Assign(keys);
  std::uniform_int_distribution<int> any(0, 99);
  for (int i = 0; i < 20000; ++i) {
    const int contact = i % 2 ? any(rng) : queue.top();
    keys[contact] = i % 3 ? uniform(rng) : coarse(rng);
    queue.Update(contact, keys[contact]);
    ASSERT_EQ(queue.top(), FirstOf(keys));
    ASSERT_EQ(queue.top_key(), keys[queue.top()]);
  }
}

TEST(ContactQueue, AllocatesNothingAfterWarmUp) {
  std::vector<double> keys(50, -1);
  ContactQueue queue;
  queue.Assign(keys);
  keys.resize(40);
  const testing::AllocationCounter counter;
  queue.Assign(keys);
  for (int i = 0; i < 40; ++i) queue.Update(i, i);
  EXPECT_EQ(counter.count(), 0);
}

}  // namespace
}  // namespace islet
