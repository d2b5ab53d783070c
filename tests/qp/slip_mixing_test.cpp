#include "qp/slip_mixing.h"

#include <gtest/gtest.h>

#include <Eigen/Core>

#include <cmath>
#include <vector>

namespace islet::qp {
namespace {

// Slips found by a problem that is given others: linear, with the answer x = (1, 2, 3).
std::vector<double> Found(const std::vector<double>& given, double factor) {
  const Eigen::Vector3d answer(1, 2, 3);
  Eigen::Matrix3d slope;
  slope << 1, 0.2, 0, 0.1, -0.5, 0.3, 0, 0.2, 0.7;
  const Eigen::Vector3d found = answer + factor * slope * (Eigen::Map<const Eigen::Vector3d>(given.data()) - answer);
  return {found[0], found[1], found[2]};
}

double Miss(const std::vector<double>& slips) { return std::hypot(slips[0] - 1, slips[1] - 2, slips[2] - 3); }

TEST(SlipMixing, FindsTheAnswerOfALinearProblemInAsManyRoundsAsItHasDirections) {
  for (const double factor : {0.5, 0.9, 1.5}) {  // the last one would go astray without mixing
    SlipMixing mixing;
    mixing.Begin(3);
    std::vector<double> slips{0.9, 2.2, 2.9};
    for (int round = 0; round < 4; ++round) {
      mixing.Add(slips, Found(slips, factor));
      mixing.Next(&slips);
    }
    EXPECT_LT(Miss(slips), 1e-9) << factor;
  }
}

TEST(SlipMixing, TheFirstSlipsAreThoseFound) {
  SlipMixing mixing;
  mixing.Begin(3);
  std::vector<double> slips;
  mixing.Add({0, 0, 0}, {1, 2, 3});
  mixing.Next(&slips);
  EXPECT_EQ(slips, (std::vector<double>{1, 2, 3}));
}

TEST(SlipMixing, SlipsAreNotNegativeAndPairsThatSayNothingNewDoNoHarm) {
  SlipMixing mixing;
  mixing.Begin(2);
  std::vector<double> slips;
  mixing.Add({1, 1}, {0.4, 0.7});
  mixing.Add({0.5, 0.9}, {0.01, 0.6});
  mixing.Add({0.5, 0.9}, {0.01, 0.6});
  mixing.Next(&slips);
  for (const double slip : slips) EXPECT_TRUE(slip >= 0 && slip < 10) << slip;
}

TEST(SlipMixing, ForgetsWhatWasBefore) {
  SlipMixing mixing;
  std::vector<double> slips;
  for (int time = 0; time < 2; ++time) {
    mixing.Begin(3);
    mixing.Add({0, 0, 0}, {1, 2, 3});
    mixing.Next(&slips);
    EXPECT_EQ(slips, (std::vector<double>{1, 2, 3}));
    mixing.Add(slips, Found(slips, 0.5));
    mixing.Next(&slips);
  }
}

}  // namespace
}  // namespace islet::qp
