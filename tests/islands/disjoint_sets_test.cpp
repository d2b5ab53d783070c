#include "islands/disjoint_sets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace islet::islands {
namespace {

TEST(DisjointSets, StartsWithEveryElementAlone) {
  std::vector<int> parents(3, 99);
  DisjointSets sets(parents);
  for (int element = 0; element < 3; ++element) EXPECT_EQ(sets.Find(element), element);
}

TEST(DisjointSets, SmallestMemberIsRootInAnyOrder) {
  std::vector<int> parents(6);
  DisjointSets sets(parents);
  EXPECT_TRUE(sets.Union(5, 3));
  EXPECT_TRUE(sets.Union(4, 5));
  EXPECT_EQ(sets.Find(4), 3);
  EXPECT_TRUE(sets.Union(1, 4));
  EXPECT_FALSE(sets.Union(3, 1));
  for (const int element : {1, 3, 4, 5}) EXPECT_EQ(sets.Find(element), 1);
  EXPECT_EQ(sets.Find(0), 0);
  EXPECT_EQ(sets.Find(2), 2);
}

// Against labels that are rewritten as a whole at every union; and parents never exceed their children.
TEST(DisjointSets, AgreesWithRelabelling) {
  constexpr int kElements = 60;
  std::mt19937 random(7);
  std::uniform_int_distribution<int> element(0, kElements - 1);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<int> parents(kElements);
    DisjointSets sets(parents);
    std::vector<int> labels(kElements);
    for (int i = 0; i < kElements; ++i) labels[i] = i;
    for (int k = 0; k < 45; ++k) {
      const int a = element(random);
      const int b = element(random);
      const int keep = std::min(labels[a], labels[b]);
      const int drop = std::max(labels[a], labels[b]);
      EXPECT_EQ(sets.Union(a, b), keep != drop);
      for (int& label : labels) label = label == drop ? keep : label;
    }
    for (int i = 0; i < kElements; ++i) {
      EXPECT_LE(parents[i], i);
      EXPECT_EQ(sets.Find(i), labels[i]);
    }
  }
}

}  // namespace
}  // namespace islet::islands
