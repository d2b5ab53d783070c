// Corrections of overlaps: a tower's, as a column and by the rungs above it.
#include "engine/correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace islet {
namespace {

// Cubes of side 1 on a wall, body 0, each sunk a little into what it stands on; their centres lean by up to `lean`, and if they do
// not, some are a little above it.
struct Tower {
  Tower(const std::vector<double>& masses, double lean, std::uint32_t seed) {
    std::mt19937 rng(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    bodies.resize(masses.size() + 1);
    bodies[0].kind = BodyKind::kFixed;
    bodies[0].position_W = {0, 0, -0.5};
    for (size_t i = 0; i < masses.size(); ++i) {
      Body& cube = bodies[i + 1];
      cube.mass = masses[i];
      cube.inertia_B = masses[i] / 6 * Matrix3::Identity();
      cube.radius = std::sqrt(0.75);
      cube.position_W = Vector3(lean * uniform(rng), lean * uniform(rng), static_cast<double>(i) + 0.5);
      const double gap = 1e-3 * (lean > 0 ? 0.5 * uniform(rng) - 0.5 : uniform(rng));
      for (int corner = 0; corner < 4; ++corner) {
        const Vector3 at(corner % 2 - 0.5, corner / 2 - 0.5, static_cast<double>(i));
        contacts.push_back(
            {.body_a = static_cast<int>(i), .body_b = static_cast<int>(i) + 1, .point_W = at, .gap = gap});
        frames.push_back(ContactFrame(contacts.back().normal_W));
        gaps.push_back(gap);
      }
    }
    members.resize(masses.size());
    std::iota(members.begin(), members.end(), 1);
    places.resize(contacts.size());
    std::iota(places.begin(), places.end(), 0);
    free_way.assign(bodies.size(), 1.0);
  }

  IslandToCorrect Island() const { return {members, places, {contacts, frames}, gaps, free_way, 1e-3}; }

  // [m] the deepest overlap that is left.
  double Left(const Corrector& corrector) const {
    double left = 0;
    for (size_t c = 0; c < contacts.size(); ++c) left = std::max(left, -GapAfter(corrector, static_cast<int>(c)));
    return left;
  }
  double GapAfter(const Corrector& corrector, int c) const {
    const Contact& contact = contacts[c];
    const auto shift = [&](int body) -> Vector3 {
      if (body == 0) return Vector3::Zero();
      const Displacement d = corrector.CorrectionOf(body - 1);
      return d.linear + d.angular.cross(contact.point_W - bodies[body].position_W);
    };
    return gaps[c] + contact.normal_W.dot(shift(contact.body_b) - shift(contact.body_a));
  }

  std::vector<Body> bodies;
  std::vector<Contact> contacts;
  std::vector<Matrix3> frames;
  std::vector<double> gaps, free_way;
  std::vector<int> members, places;
};

std::int64_t Columns(Corrector* corrector) {
  return corrector->TakeReport().rungs[static_cast<int>(qp::Rung::kColumn)].problems;
}

TEST(Correction, TowersAreColumns) {
  for (const double top : {1.0, 100.0, 1e6}) {
    for (const double lean : {0.0, 1e-9, 0.05}) {
      for (std::uint32_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(::testing::Message() << top << " " << lean << " " << seed);
        const Tower tower({1, 2, 1, 1, top}, lean, seed);
        Corrector column{qp::Ladder()}, others{qp::Ladder().Without(qp::Rung::kColumn)};
        ASSERT_TRUE(column.Solve(tower.Island(), tower.bodies));
        ASSERT_TRUE(others.Solve(tower.Island(), tower.bodies));
        EXPECT_EQ(Columns(&column), 1);
        EXPECT_EQ(Columns(&others), 0);
        EXPECT_LE(tower.Left(column), 1e-12);
        for (size_t i = 0; i < tower.members.size(); ++i) {
          EXPECT_LT((column.CorrectionOf(i).linear - others.CorrectionOf(i).linear).norm(), 2e-8);
          EXPECT_LT(column.CorrectionOf(i).angular.norm(), 1e-15);
        }
      }
    }
  }
}

// A thousand light and heavy cubes in turn, in the air: sums lose digits there, and what is not fine is not a column's to give.
TEST(Correction, ColumnsThatLoseDigitsAreRefused) {
  std::vector<double> masses;
  for (int i = 0; i < 1000; ++i) masses.push_back(i % 2 == 0 ? 1 : 1e-9);
  Tower tower(masses, 0, 1);
  tower.contacts.erase(tower.contacts.begin(), tower.contacts.begin() + 4);
  tower.gaps.erase(tower.gaps.begin(), tower.gaps.begin() + 4);
  tower.frames.resize(tower.contacts.size());
  tower.places.resize(tower.contacts.size());
  Corrector corrector{qp::Ladder()};
  corrector.Solve(tower.Island(), tower.bodies);
  EXPECT_EQ(Columns(&corrector), 0);
}

TEST(Correction, GapsThatAreNoNumbersAreRefused) {
  for (const double bad : {std::nan(""), -std::numeric_limits<double>::infinity()}) {
    Tower tower({1, 1, 1}, 0, 1);
    tower.gaps[5] = bad;
    Corrector corrector{qp::Ladder()};
    EXPECT_FALSE(corrector.Solve(tower.Island(), tower.bodies));
  }
}

}  // namespace
}  // namespace islet
