#include "engine/geometry/face_contact.h"

#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "engine/geometry/box_distance.h"
#include "engine/geometry/narrow_phase.h"
#include "tests/support/box_overlap.h"

namespace islet {
namespace {

const Shape kBox = Shape::Box({0.5, 0.5, 0.5});

Shape BoxAsHull() { return Shape::ConvexHull(kBox.polytope().vertices); }

Placement At(const Vector3& position, const Quaternion& rotation) {
  return {position, rotation.normalized().toRotationMatrix()};
}

// Boxes that a random direction holds apart: the same distance as by the code for polytopes, and points of both boxes.
TEST(ClosestOfBoxes, IsThatOfPolytopes) {
  std::mt19937 rng(11);
  auto uniform = [&](double lower, double upper) { return std::uniform_real_distribution<double>(lower, upper)(rng); };
  auto vector = [&](double size) { return Vector3(uniform(-size, size), uniform(-size, size), uniform(-size, size)); };
  int edges = 0, beyond = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const Shape a = Shape::Box(Vector3(1.1, 1.1, 1.1) + vector(1)), b = Shape::Box(Vector3(1.1, 1.1, 1.1) + vector(1));
    const Matrix3 rotation =
        trial % 5 == 0 ? Matrix3::Identity() : Matrix3(Quaternion(Eigen::Vector4d::Random().normalized()));
    const Vector3 n = vector(1).normalized();
    const double separation = trial % 7 == 0 ? 1e-6 : uniform(0, 0.5);
    double top = -1e9, bottom = 1e9;
    for (const Vector3& v : a.polytope().vertices) top = std::max(top, n.dot(v));
    for (const Vector3& v : b.polytope().vertices) bottom = std::min(bottom, n.dot(rotation * v));
    Vector3 position = vector(2);
    position += (top - bottom + separation - n.dot(position)) * n;
    const ClosestPoints expected =
        ClosestOfApart(a.polytope(), a.size(), b.polytope(), b.size(), rotation, position, n, separation);
    const ClosestPoints found = ClosestOfBoxes(a, b, rotation, position, n, separation, 1e3);
    ASSERT_NEAR(found.distance, expected.distance, 1e-12);
    EXPECT_NEAR((found.on_b - found.on_a).norm(), found.distance, 1e-12);
    EXPECT_LE((found.on_a.cwiseAbs() - a.half_extents()).maxCoeff(), 1e-12);
    EXPECT_LE(((rotation.transpose() * (found.on_b - position)).cwiseAbs() - b.half_extents()).maxCoeff(), 1e-12);
    edges += found.feature >= 16;
    const double limit = uniform(0, 1);
    const ClosestPoints limited = ClosestOfBoxes(a, b, rotation, position, n, separation, limit);
    if (expected.distance <= limit) {
      EXPECT_NEAR(limited.distance, expected.distance, 1e-12);
    } else {
      EXPECT_GT(limited.distance, limit);
      ++beyond;
    }
  }
  EXPECT_GT(edges, 200);
  EXPECT_GT(beyond, 200);
}

// Two cubes that only one pair of edges separates (by 45 mm), while those edges pass each other by: all faces' axes overlap,
// and the deepest corner of the least of them was reported 42 mm inside.
TEST(AppendNearestPoints, CubesThatOnlyEdgesSeparate) {
  const Placement a = At({3.4836709801239851, 7.0288391711426597, 27.196152422706632},
                         {0.88787259108794558, -0.3700096513910982, -0.26009268417971143, -0.084421060810727935});
  const Placement b = At({3.4862454966019265, 6.9875952108239225, 28.946152422706632},
                         {0.47274001384012115, -0.81845842955262427, 0.27173367425371858, 0.18111733402760774});
  const double depth = testing::BoxOverlap(kBox.half_extents(), a, kBox.half_extents(), b);
  EXPECT_NEAR(depth, -0.045485, 1e-6);
  for (const Shape& shape : {kBox, BoxAsHull()}) {
    std::vector<Contact> contacts;
    CollideShapes(shape, a, shape, b, 0.3, &contacts);
    ASSERT_EQ(contacts.size(), 1u);
    EXPECT_GE(contacts[0].gap, -depth);
    contacts.clear();
    CollideShapes(shape, a, shape, b, 0.04, &contacts);
    EXPECT_TRUE(contacts.empty());
  }
}

// No pair that is apart may be told to overlap, and the least gap is at least what the separating axis proves.
TEST(AppendNearestPoints, BoxesThatAreApartNeverOverlap) {
  std::mt19937 rng(1);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform(0, 1);
  int apart = 0;
  for (int trial = 0; trial < 200000; ++trial) {
    const Vector3 half_a(0.5, 0.5, 0.5), half_b = trial % 2 ? half_a : Vector3(0.2, 0.5, 0.8);
    const Shape second = Shape::Box(half_b);
    const auto rotation = [&] { return Quaternion(gauss(rng), gauss(rng), gauss(rng), gauss(rng)); };
    const Placement a = At(Vector3::Zero(), rotation());
    const Placement b =
        At((1 + 0.8 * uniform(rng)) * Vector3(gauss(rng), gauss(rng), gauss(rng)).normalized(), rotation());
    const double separation = -testing::BoxOverlap(half_a, a, half_b, b);
    if (separation < 1e-3) continue;
    ++apart;
    std::vector<Contact> contacts;
    CollideShapes(kBox, a, second, b, 0.2, &contacts);
    if (contacts.empty()) continue;
    const double least = std::min_element(contacts.begin(), contacts.end(), [](const Contact& x, const Contact& y) {
                           return x.gap < y.gap;
                         })->gap;
    EXPECT_GE(least, separation - 1e-3) << trial;
  }
  EXPECT_GT(apart, 50000);
}

// The end of a ridge over the middle of another, all but parallel: neither a face nor a pair of edges tells how far they are apart.
TEST(AppendNearestPoints, RidgesThatAllButTouchDoNotOverlap) {
  std::vector<Vector3> roof;
  for (const double x : {-0.15, 0.15}) {
    for (const double y : {-0.1, 0.1}) roof.emplace_back(x, y, 0);
    roof.emplace_back(x, 0, 0.1);
  }
  const Shape shape = Shape::ConvexHull(roof);
  const auto& corners = shape.polytope().vertices;
  const auto highest = [](const Vector3& u, const Vector3& v) { return u.z() < v.z(); };
  const double ridge = std::max_element(corners.begin(), corners.end(), highest)->z();
  for (const double tilt : {0.02, 0.0372, 0.1})
    for (const double gap : {1e-6, 1e-5, 1e-4, 1e-3}) {
      const Quaternion turned(Eigen::AngleAxisd(std::numbers::pi - tilt, Vector3::UnitY()));
      double lowest = 0;
      for (const Vector3& corner : corners) lowest = std::min(lowest, (turned * corner).z());
      std::vector<Contact> contacts;
      CollideShapes(shape, At(Vector3::Zero(), Quaternion::Identity()), shape,
                    At({0.05, 0, ridge + gap - lowest}, turned), 0.01, &contacts);
      ASSERT_EQ(contacts.size(), 1u) << tilt << ' ' << gap;
      EXPECT_NEAR(contacts[0].gap, gap, 1e-3 * gap) << tilt << ' ' << gap;
      EXPECT_GT(contacts[0].normal_W.z(), 0.999) << tilt << ' ' << gap;
    }
}

}  // namespace
}  // namespace islet
