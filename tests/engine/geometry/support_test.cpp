// Sides of two shapes that face each other, counted by hand.
#include "engine/geometry/support.h"

#include <vector>

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace islet
