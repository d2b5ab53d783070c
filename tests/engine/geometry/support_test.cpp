// Sides of two shapes that face each other, counted by hand.
#include "engine/geometry/support.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "engine/geometry/edge_contact.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

std::vector<Vector3> Facing(const Shape& a, const Vector3& at_a, const Shape& b, const Vector3& at_b, double deep,
                            double turn = 0) {
  std::vector<Vector3> normals;
  FacingSides(a, {at_a, Matrix3::Identity()}, b,
              {at_b, testing::Turn(turn, Vector3(1, 2, 3).normalized()).toRotationMatrix()}, deep, &normals);
  return normals;
}

TEST(Support, CubesFaceEachOtherAlongAllThatParts) {
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  EXPECT_EQ(Facing(cube, {0, 0, 0}, cube, {1, 0, 0}, 1e-9).size(), 1);
  EXPECT_EQ(Facing(cube, {0, 0, 0}, cube, {1, 0.3, -0.2}, 1e-9).size(), 1);
  EXPECT_EQ(Facing(cube, {0, 0, 0}, cube, {1, 0, -1}, 1e-9).size(), 2);  // by an edge
  EXPECT_EQ(Facing(cube, {0, 0, 0}, cube, {1, 1, 1}, 1e-9).size(), 3);   // by a corner
  EXPECT_EQ(Facing(cube, {0, 0, 0}, cube, {1, 0.999, 0}, 1e-9).size(), 1);
  EXPECT_EQ(Facing(cube, {0, 0, 0}, cube, {1, 0.999, 0}, 2e-3).size(), 2);
  EXPECT_TRUE(Facing(cube, {0, 0, 0}, cube, {1, 0, -1}, 1e-9, 0.1).empty());
}

TEST(Support, NormalsPointFromOneToTheOther) {
  const std::vector<Vector3> up =
      Facing(Shape::Box({1, 1, 0.5}), {0, 0, 0}, Shape::Cylinder(0.3, 0.4), {0, 0, 0.9}, 1e-9);
  ASSERT_EQ(up.size(), 1);
  EXPECT_LT((up[0] - Vector3::UnitZ()).norm(), 1e-12);
  EXPECT_TRUE(Facing(Shape::Sphere(0.5), {0, 0, 0}, Shape::Sphere(0.5), {1, 0, 0}, 1e-9).empty());
}

// Of two sides that are not quite parallel the one counts along which bodies are farther apart.
TEST(Support, SidesThatAreAskewABitTakeTheBetterOne) {
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  for (const double turn : {1e-3, -1e-3}) {
    const std::vector<Vector3> normals = Facing(cube, {0, 0, 0}, cube, {1, 0.4, 0}, 0.01, turn);
    ASSERT_FALSE(normals.empty());
    const Placement placed_a,
        placed_b{{1, 0.4, 0}, testing::Turn(turn, Vector3(1, 2, 3).normalized()).toRotationMatrix()};
    const double by_normal = SeparationAlong(cube, placed_a, cube, placed_b, normals[0]);
    EXPECT_GE(by_normal, SeparationAlong(cube, placed_a, cube, placed_b, Vector3::UnitX()));
    EXPECT_GE(by_normal, SeparationAlong(cube, placed_a, cube, placed_b, placed_b.rotation_WB.col(0)));
  }
}

// Most sides are passed over for one corner of the other shape. What is found is what all pairs of sides give.
TEST(Support, FacingSidesAreThoseOfAllPairs) {
  std::mt19937 random(7);
  const auto number = [&](double most) { return std::uniform_real_distribution<double>(-most, most)(random); };
  const auto hull = [&](bool flat) {
    std::vector<Vector3> corners;
    for (int i = 0; i < 12; ++i)
      corners.emplace_back(number(0.5), number(0.5), flat ? (i < 6 ? 0.5 : -0.5) : number(0.5));
    return Shape::ConvexHull(corners);
  };
  int found = 0, by_b_alone = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const Shape shapes[] = {Shape::Box({0.5, 0.3, 0.5}), hull(true), Shape::Cylinder(0.5, 0.4), hull(false)};
    const Shape &a = shapes[trial % 4], &b = shapes[trial / 4 % 4];
    const double far = 0.5 * (FlatSides(a).size() == 2 ? 0.8 : 1) + 0.5 * (FlatSides(b).size() == 2 ? 0.8 : 1);
    const Placement placed_a{},
        placed_b{{number(0.4), number(0.4), far + number(0.01)},
                 testing::Turn(number(0.008), Vector3(1, 2, 3).normalized()).toRotationMatrix()};
    const double deep = 0.01;
    std::vector<Vector3> normals, all;
    FacingSides(a, placed_a, b, placed_b, deep, &normals);
    for (const Vector3& of_a : FlatSides(a))
      for (const Vector3& side_b : FlatSides(b)) {
        const Vector3 against_b = -(placed_b.rotation_WB * side_b);
        if ((of_a - against_b).norm() >= kAngle) continue;
        const double by_a = SeparationAlong(a, placed_a, b, placed_b, of_a),
                     by_b = SeparationAlong(a, placed_a, b, placed_b, against_b);
        by_b_alone += by_a < -deep && by_b >= -deep;
        if (std::max(by_a, by_b) >= -deep) all.push_back(by_a >= by_b ? of_a : against_b);
      }
    EXPECT_EQ(normals, all) << trial;
    found += static_cast<int>(all.size());
  }
  EXPECT_GT(found, 300);
  EXPECT_GT(by_b_alone, 3);
}

}  // namespace
}  // namespace islet
