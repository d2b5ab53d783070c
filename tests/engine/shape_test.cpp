#include "engine/shape.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/worlds.h"

namespace islet {
namespace {

std::vector<Vector3> BoxCorners(const Vector3& half) {
  std::vector<Vector3> corners;
  for (int c = 0; c < 8; ++c) {
    corners.emplace_back((c & 1) ? half.x() : -half.x(), (c & 2) ? half.y() : -half.y(),
                         (c & 4) ? half.z() : -half.z());
  }
  return corners;
}

Matrix3 SomeRotation() { return Eigen::AngleAxisd(1.1, Vector3(1, -2, 0.5).normalized()).toRotationMatrix(); }

// Closed, convex, Euler's formula, normals outward, both edge tables right. flat: share of the extent.
void ExpectValid(const Polytope& polytope, double flat = 1e-9) {
  const int V = static_cast<int>(polytope.vertices.size()), F = static_cast<int>(polytope.faces.size());
  const int E = static_cast<int>(polytope.edges.size());
  EXPECT_EQ(V - E + F, 2);
  ASSERT_EQ(polytope.face_normals.size(), polytope.faces.size());
  ASSERT_EQ(polytope.edge_faces.size(), polytope.edges.size());
  double extent = 0;
  for (const Vector3& v : polytope.vertices) extent = std::max(extent, v.norm());
  std::set<std::pair<int, int>> directed;
  for (int f = 0; f < F; ++f) {
    const std::vector<int>& loop = polytope.faces[f];
    const Vector3& normal = polytope.face_normals[f];
    EXPECT_NEAR(normal.norm(), 1, 1e-14);
    for (const Vector3& v : polytope.vertices) EXPECT_LE(normal.dot(v - polytope.vertices[loop[0]]), flat * extent);
    for (size_t k = 0; k < loop.size(); ++k) {
      const int from = loop[k], to = loop[(k + 1) % loop.size()], after = loop[(k + 2) % loop.size()];
      EXPECT_TRUE(directed.insert({from, to}).second);
      EXPECT_NEAR(normal.dot(polytope.vertices[from] - polytope.vertices[loop[0]]), 0, flat * extent);
      const Vector3 turn =
          (polytope.vertices[to] - polytope.vertices[from]).cross(polytope.vertices[after] - polytope.vertices[to]);
      EXPECT_GT(turn.dot(normal), 0);  // counter-clockwise, strictly convex
    }
  }
  EXPECT_EQ(static_cast<int>(directed.size()), 2 * E);
  for (int e = 0; e < E; ++e) {
    EXPECT_LT(polytope.edges[e][0], polytope.edges[e][1]);
    EXPECT_LT(polytope.edge_faces[e][0], polytope.edge_faces[e][1]);
    for (int face : polytope.edge_faces[e]) {
      for (int end : polytope.edges[e]) {
        EXPECT_EQ(std::count(polytope.faces[face].begin(), polytope.faces[face].end(), end), 1);
      }
    }
  }
}

void ExpectError(const std::string& part, const std::function<void()>& action) {
  try {
    action();
    FAIL() << "no error that mentions " << part;
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

TEST(Sphere, MassBySchoolFormula) {
  const Shape sphere = Shape::Sphere(2);
  EXPECT_NEAR(sphere.Volume(), 33.510321638291124, 1e-12);
  EXPECT_TRUE(sphere.MassFromMass(5).inertia_B.isApprox(8 * Matrix3::Identity(), 1e-15));
  EXPECT_DOUBLE_EQ(sphere.radius(), 2);
  EXPECT_DOUBLE_EQ(sphere.size(), 4);
}

TEST(Box, MassBySchoolFormula) {
  const Shape box = Shape::Box({0.5, 1, 1.5});  // 1 x 2 x 3
  const MassProperties mass = box.MassFromDensity(2);
  EXPECT_DOUBLE_EQ(mass.mass, 12);
  EXPECT_TRUE(mass.inertia_B.isApprox(Matrix3(Vector3(13, 10, 5).asDiagonal()), 1e-15));
  EXPECT_DOUBLE_EQ(box.size(), 1);
  EXPECT_DOUBLE_EQ(box.radius(), std::sqrt(3.5));
  ExpectValid(box.polytope());
  EXPECT_EQ(box.polytope().faces.size(), 6u);
}

TEST(HalfSpace, HasNoMass) {
  EXPECT_TRUE(std::isinf(Shape::HalfSpace().radius()));
  ExpectError("half-space", [] { Shape::HalfSpace().MassFromMass(1); });
  ExpectError("half-space", [] { Shape::HalfSpace().MassFromDensity(1); });
}

// Corners at the origin and at 1 on each axis: V = 1/6, centroid (1,1,1)/4, and about it I_xx = 3/40 m, I_xy = m/80.
TEST(ConvexHull, UnitTetrahedron) {
  const Shape hull = Shape::ConvexHull(std::vector<Vector3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
  EXPECT_NEAR(hull.Volume(), 1.0 / 6, 1e-16);
  EXPECT_TRUE(hull.hull_offset().isApprox(Vector3::Constant(0.25), 1e-15));
  Matrix3 expected = Matrix3::Constant(1.0 / 80);
  expected.diagonal().setConstant(3.0 / 40);
  EXPECT_TRUE(hull.MassFromMass(1).inertia_B.isApprox(expected, 1e-14)) << hull.MassFromMass(1).inertia_B;
  ExpectValid(hull.polytope());
  EXPECT_NEAR(hull.size(), 1 / std::sqrt(3.0), 1e-15);  // height over the slanted face
  // Between opposite edges: of a regular one of edge 1, and of a sliver.
  const double half = std::sqrt(0.125);
  EXPECT_NEAR(
      Shape::ConvexHull(
          std::vector<Vector3>{{half, half, half}, {half, -half, -half}, {-half, half, -half}, {-half, -half, half}})
          .size(),
      std::sqrt(0.5), 1e-15);
  EXPECT_NEAR(Shape::ConvexHull(std::vector<Vector3>{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0.1}, {0, -1, 0.1}}).size(), 0.1,
              1e-15);
  EXPECT_NEAR(hull.radius(), std::sqrt(11.0) / 4, 1e-15);
}

TEST(ConvexHull, OfBoxCornersIsTheBoxWhateverTheFrame) {
  const Vector3 half(0.5, 1, 1.5), shift(100, -20, 3);
  const Matrix3 R = SomeRotation();
  std::vector<Vector3> points;
  for (const Vector3& corner : BoxCorners(half)) points.push_back(shift + R * corner);
  const Shape hull = Shape::ConvexHull(points);
  ExpectValid(hull.polytope());
  EXPECT_EQ(hull.polytope().faces.size(), 6u);
  EXPECT_EQ(hull.polytope().edges.size(), 12u);
  EXPECT_NEAR(hull.Volume(), 6, 1e-12);
  EXPECT_LE((hull.hull_offset() - shift).norm(), 1e-12);
  const Matrix3 expected = R * Shape::Box(half).MassFromMass(12).inertia_B * R.transpose();
  EXPECT_TRUE(hull.MassFromMass(12).inertia_B.isApprox(expected, 1e-12));
  EXPECT_NEAR(hull.size(), 1, 1e-12);
}

TEST(ConvexHull, DropsInnerRepeatedAndCoplanarPoints) {
  std::vector<Vector3> points = BoxCorners({1, 1, 1});
  for (int i = -2; i <= 2; ++i) {
    for (int k = -2; k <= 2; ++k) {
      for (double z : {-1.0, 0.1, 1.0}) points.emplace_back(i / 2.0, k / 2.0, z);
    }
  }
  points.insert(points.end(), points.begin(), points.begin() + 8);
  std::mt19937 rng(7);
  for (int trial = 0; trial < 20; ++trial) {
    std::shuffle(points.begin(), points.end(), rng);
    std::vector<Vector3> turned;
    for (const Vector3& p : points) turned.push_back(SomeRotation() * p);
    const Shape hull = Shape::ConvexHull(turned);
    ExpectValid(hull.polytope());
    EXPECT_EQ(hull.polytope().vertices.size(), 8u);
    EXPECT_EQ(hull.polytope().faces.size(), 6u);
    EXPECT_NEAR(hull.Volume(), 8, 1e-12);
  }
}

// Points of meshes lie on faces and edges, and what turned them has left rounding in them.
TEST(ConvexHull, OfPointsOnABoxIsTheBoxHoweverItIsTurned) {
  const Vector3 half(0.3, 0.2, 0.1);
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const int count : {3, 4, 5}) {
    std::vector<Vector3> grid;
    for (int i = 0; i < count; ++i)
      for (int j = 0; j < count; ++j)
        for (int k = 0; k < count; ++k) {
          const Vector3 at = 2.0 / (count - 1) * Vector3(i, j, k) - Vector3::Ones();
          if (at.cwiseAbs().maxCoeff() == 1) grid.push_back(at.cwiseProduct(half));
        }
    for (const double degrees : {0, 30, 45, 90, 180})
      for (const Vector3& axis : {Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(0, 0, 1), Vector3(1, 1, 1)})
        for (const double noise : {0.0, 1e-16, 1e-13}) {
          const Eigen::AngleAxisd turn(degrees * std::numbers::pi / 180, axis.normalized());
          std::vector<Vector3> points;
          for (const Vector3& p : grid)
            points.push_back(turn * p + noise * Vector3(normal(random), normal(random), normal(random)));
          const Shape hull = Shape::ConvexHull(points);
          EXPECT_EQ(hull.polytope().faces.size(), 6u) << count << ' ' << degrees << ' ' << noise;
          EXPECT_EQ(hull.polytope().vertices.size(), 8u) << count << ' ' << degrees << ' ' << noise;
          EXPECT_NEAR(hull.Volume(), 8 * half.prod(), 1e-13);
        }
  }
}

TEST(ConvexHull, PrismsHaveTwoPolygons) {
  const double pi = std::acos(-1.0);
  for (int sides : {3, 5, 6, 12, 40}) {
    std::vector<Vector3> points;
    for (int k = 0; k < sides; ++k) {
      for (double z : {-1.0, 1.0})
        points.push_back(SomeRotation() * Vector3(std::cos(2 * pi * k / sides), std::sin(2 * pi * k / sides), z));
    }
    const Shape hull = Shape::ConvexHull(points);
    ExpectValid(hull.polytope());
    EXPECT_EQ(static_cast<int>(hull.polytope().faces.size()), sides + 2);
    EXPECT_NEAR(hull.Volume(), sides * std::sin(2 * pi / sides), 1e-12);
  }
}

// Against a sum over random points: the moments of a polytope with many faces.
TEST(ConvexHull, RandomCloudsAndTheirMoments) {
  std::mt19937 rng(9);
  std::normal_distribution<double> gauss;
  for (int count : {4, 5, 8, 20, 100, 400}) {
    std::vector<Vector3> points;
    for (int i = 0; i < count; ++i) {
      Vector3 point(gauss(rng), gauss(rng), gauss(rng));
      if (count >= 100) point.normalize();  // all on the sphere: all are vertices
      points.push_back(point + Vector3(5, 6, 7));
    }
    const Shape hull = Shape::ConvexHull(points);
    ExpectValid(hull.polytope(), 2e-5);  // four of 400 points may be that near to one plane
    if (count >= 100) {
      EXPECT_EQ(static_cast<int>(hull.polytope().vertices.size()), count);
    }
    for (const Vector3& p : points) {
      for (size_t f = 0; f < hull.polytope().faces.size(); ++f) {
        const Vector3& corner = hull.polytope().vertices[hull.polytope().faces[f][0]];
        EXPECT_LE(hull.polytope().face_normals[f].dot(p - hull.hull_offset() - corner), 1e-8);
      }
    }
    if (count == 400) {
      const double full = Shape::Sphere(1).Volume();
      EXPECT_NEAR(hull.Volume(), full, 0.05 * full);
      EXPECT_TRUE(hull.MassFromMass(1).inertia_B.isApprox(Shape::Sphere(1).MassFromMass(1).inertia_B, 0.05));
    }
  }
}

// Corners of a turned box as a mesh in single precision has them, or a text of seven digits, and each of them twice. Its faces are flat, and not
// split by noise: a half would hold what lies on the whole.
TEST(ConvexHull, NoiseOfMeshesSplitsNoFace) {
  std::mt19937 random(3);
  for (const double noise : {1e-12, 1e-10, 1e-8, 6e-8, 1e-6}) {
    for (int trial = 0; trial < 20; ++trial) {
      const auto number = [&](double most) { return std::uniform_real_distribution<double>(-most, most)(random); };
      const Matrix3 turn = testing::Turn(number(3), Vector3(number(1), number(1), 1).normalized()).toRotationMatrix();
      std::vector<Vector3> points;
      for (int corner = 0; corner < 16; ++corner) {
        const Vector3 at(corner & 1 ? 0.05 : -0.05, corner & 2 ? 0.035 : -0.035, corner & 4 ? 0.025 : -0.025);
        points.push_back(turn * at + 0.1 * noise * Vector3(number(1), number(1), number(1)));
      }
      const Shape hull = Shape::ConvexHull(points);
      EXPECT_EQ(hull.polytope().vertices.size(), 8) << noise;
      EXPECT_EQ(hull.polytope().faces.size(), 6) << noise;
      EXPECT_NEAR(hull.Volume(), 0.1 * 0.07 * 0.05, 10 * noise * 0.1 * 0.07 * 0.05) << noise;
    }
  }
  // What is thin keeps its thickness.
  const Shape plate =
      Shape::ConvexHull(std::vector<Vector3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5, 0.5, 1e-5}});
  EXPECT_EQ(plate.polytope().vertices.size(), 5);
}

// The hull is cut in two by a plane through its middle; volume, first and second moments must add up.
TEST(ConvexHull, MomentsOfHalvesAddUp) {
  const Shape whole = Shape::ConvexHull(BoxCorners({1, 2, 3}));
  std::vector<Vector3> left = BoxCorners({0.5, 2, 3}), right = left;
  for (Vector3& p : left) p.x() -= 0.5;
  for (Vector3& p : right) p.x() += 0.5;
  Matrix3 sum = Matrix3::Zero();
  for (const auto& part : {left, right}) {
    const Shape shape = Shape::ConvexHull(part);
    const MassProperties mass = shape.MassFromDensity(1);
    const Vector3 d = shape.hull_offset();
    sum += mass.inertia_B + mass.mass * (d.squaredNorm() * Matrix3::Identity() - d * d.transpose());
  }
  EXPECT_TRUE(sum.isApprox(whole.MassFromDensity(1).inertia_B, 1e-13));
}

TEST(Errors, NameFieldAndValue) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ExpectError("Sphere radius must be positive and finite, got -1", [] { Shape::Sphere(-1); });
  ExpectError("Sphere radius", [nan] { Shape::Sphere(nan); });
  ExpectError("Box half_extents.y must be positive and finite, got 0", [] { Shape::Box({1, 0, 1}); });
  ExpectError("density", [] { Shape::Sphere(1).MassFromDensity(0); });
  ExpectError("mass", [nan] { Shape::Sphere(1).MassFromMass(nan); });
  ExpectError("got 3", [] { Shape::ConvexHull(std::vector<Vector3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}); });
  ExpectError("point 2 is not finite", [nan] {
    Shape::ConvexHull(std::vector<Vector3>{{0, 0, 0}, {1, 0, 0}, {0, nan, 0}, {0, 0, 1}});
  });
  ExpectError("only 1 of them differ", [] { Shape::ConvexHull(std::vector<Vector3>(10, Vector3(1, 2, 3))); });
  ExpectError("one line", [] { Shape::ConvexHull(std::vector<Vector3>{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}}); });
  ExpectError("one plane", [] {
    Shape::ConvexHull(std::vector<Vector3>{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}, {0.3, 0.2, 1}});
  });
}

// A cloud of which all points are corners would take minutes; it is refused in a second or so.
TEST(Shape, HullsOfTooManyCornersAreRefused) {
  std::vector<Vector3> points;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) {  // evenly over a sphere
    const double z = 1 - (2 * i + 1.0) / kCount, turn = 2.399963229728653 * i, r = std::sqrt(1 - z * z);
    points.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
  }
  try {
    Shape::ConvexHull(points);
    ADD_FAILURE() << "was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("4096 faces"), std::string::npos) << error.what();
  }
  for (Vector3& point : points) point *= 0.5;  // inside of a cube they cost little
  for (const double x : {-1.0, 1.0})
    for (const double y : {-1.0, 1.0})
      for (const double z : {-1.0, 1.0}) points.emplace_back(x, y, z);
  EXPECT_EQ(Shape::ConvexHull(points).polytope().vertices.size(), 8u);
}

}  // namespace
}  // namespace islet
