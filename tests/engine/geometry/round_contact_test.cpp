// Capsules and cylinders against everything: the gap is the largest separation over all directions, found here by a search over directions
// that shares nothing with the engine but the shapes' numbers.
#include "engine/geometry/round_contact.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace islet {
namespace {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double Between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  Vector3 Direction() {
    std::normal_distribution<double> normal;
    return Vector3(normal(engine_), normal(engine_), normal(engine_)).normalized();
  }
  Matrix3 Rotation() { return Eigen::AngleAxisd(Between(0, 3.1), Direction()).toRotationMatrix(); }

 private:
  std::mt19937 engine_;
};

// [m] how far the shape reaches along a direction, from its centre.
double Reach(const Shape& shape, const Matrix3& rotation, const Vector3& direction) {
  const Vector3 d = rotation.transpose() * direction;
  switch (shape.kind()) {
    case ShapeKind::kSphere:
      return shape.radius();
    case ShapeKind::kCapsule:
      return shape.girth() + shape.half_length() * std::abs(d.z());
    case ShapeKind::kCylinder:
      return shape.girth() * d.head<2>().norm() + shape.half_length() * std::abs(d.z());
    default: {
      double most = -1e300;
      for (const Vector3& v : shape.polytope().vertices) most = std::max(most, d.dot(v));
      return most;
    }
  }
}

// [m] how far a point is outside of the shape, at most 0 inside.
double Outside(const Shape& shape, const Placement& pose, const Vector3& point_W) {
  const Vector3 p = pose.rotation_WB.transpose() * (point_W - pose.position_W);
  switch (shape.kind()) {
    case ShapeKind::kSphere:
      return p.norm() - shape.radius();
    case ShapeKind::kCapsule:
      return (p - std::clamp(p.z(), -shape.half_length(), shape.half_length()) * Vector3::UnitZ()).norm() -
             shape.girth();
    case ShapeKind::kCylinder:
      return std::max(p.head<2>().norm() - shape.girth(), std::abs(p.z()) - shape.half_length());
    default: {
      double most = -1e300;
      const Polytope& polytope = shape.polytope();
      for (size_t f = 0; f < polytope.faces.size(); ++f)
        most = std::max(most, polytope.face_normals[f].dot(p - polytope.vertices[polytope.faces[f][0]]));
      return most;
    }
  }
}

double Separation(const Shape& a, const Placement& pa, const Shape& b, const Placement& pb, const Vector3& n) {
  return n.dot(pb.position_W - pa.position_W) - Reach(a, pa.rotation_WB, n) - Reach(b, pb.rotation_WB, -n);
}

// Uphill from many directions, in steps that halve where no neighbour is higher.
double LargestSeparation(const Shape& a, const Placement& pa, const Shape& b, const Placement& pb, Random* random,
                         int starts = 30) {
  double best = -1e300;
  for (int start = 0; start < starts; ++start) {
    Vector3 n = start == 0 ? Vector3((pb.position_W - pa.position_W).normalized()) : random->Direction();
    double value = Separation(a, pa, b, pb, n);
    for (double step = 0.5; step > 1e-10;) {
      bool rises = false;
      for (int k = 0; k < 60; ++k) {
        const Vector3 there = (n + step * random->Direction()).normalized();
        const double s = Separation(a, pa, b, pb, there);
        if (s > value) value = s, n = there, rises = true;
      }
      if (!rises) step *= 0.7;
    }
    best = std::max(best, value);
  }
  return best;
}

std::vector<Shape> Shapes() {
  const std::vector<Vector3> corners = {
      {0.5, 0, -0.3}, {-0.4, 0.5, -0.3}, {-0.3, -0.6, -0.2}, {0.1, 0.1, 0.7}, {0.5, 0.4, 0.3}};
  return {Shape::Sphere(0.4),        Shape::Box({0.5, 0.3, 0.4}), Shape::ConvexHull(corners), Shape::Capsule(0.2, 0.5),
          Shape::Cylinder(0.4, 0.3), Shape::Cylinder(0.1, 0.7),   Shape::Cylinder(0.6, 0.05)};
}

double LeastGap(const std::vector<Contact>& contacts) {
  double least = 1e300;
  for (const Contact& c : contacts) least = std::min(least, c.gap);
  return least;
}

// No line of centres says how far apart these are.
TEST(RoundContact, OneMiddleOverlapsBeyondAnyReach) {
  const Shape coin = Shape::Cylinder(0.3, 0.05);
  std::vector<Contact> contacts;
  CollideShapes(coin, {{1, 2, 3}, Matrix3::Identity()}, coin, {{1, 2, 3}, Matrix3::Identity()}, -1e-3, &contacts);
  ASSERT_FALSE(contacts.empty());
  EXPECT_NEAR(LeastGap(contacts), -0.1, 1e-12);
}

// A cylinder that lies across a sharp edge, nearly along it, a hair above or below: both its ends touch, on its surface and on the edge.
TEST(RoundContact, CylinderLiesOnAnEdgeAtBothEnds) {
  const Shape cylinder = Shape::Cylinder(0.12, 0.2), box = Shape::Box({0.5, 0.5, 0.1});
  const Placement at_box{{-0.5, 0, -0.1}, Matrix3::Identity()};  // the edge is the y axis
  for (const double tilt : {0.0, 0.1, 0.2}) {
    for (const double gap : {1e-3, 1e-7, 0.0, -1e-7, -1e-5}) {
      const Vector3 out = Vector3(1, 0, 1).normalized();
      Placement at{(0.12 + gap) * out, Matrix3::Identity()};
      at.rotation_WB =
          (Eigen::AngleAxisd(tilt, out) * Eigen::AngleAxisd(M_PI / 2, Vector3::UnitX())).toRotationMatrix();
      std::vector<Contact> contacts;
      CollideShapes(box, at_box, cylinder, at, 0.05, &contacts);
      int ends = 0;
      for (const Contact& c : contacts) {
        const Vector3 on_edge = c.point_W - 0.5 * c.gap * c.normal_W,
                      on_cylinder = c.point_W + 0.5 * c.gap * c.normal_W;
        EXPECT_LT(Vector3(on_edge.x(), 0, on_edge.z()).norm(), 1e-9) << tilt << " " << gap;
        EXPECT_NEAR(Outside(cylinder, at, on_cylinder), 0, 1e-9) << tilt << " " << gap;
        ends += std::abs(std::abs((at.rotation_WB.transpose() * (on_cylinder - at.position_W)).z()) - 0.2) < 1e-9;
      }
      EXPECT_EQ(ends, 2) << tilt << " " << gap;
    }
  }
}

// Two cylinders side by side at 0.25 rad, where the rim of one meets the side of the other. The end of a long side as seen across that is
// no place as deep as the separation: it was told of as 1.6e-3 m deep.
TEST(RoundContact, EndsOfSidesAreNoDeeperThanTheSeparation) {
  const Shape a = Shape::Cylinder(0.1914222099414037, 0.5185561391639807),
              b = Shape::Cylinder(0.17933035462751723, 0.24624619263499545);
  const auto turned = [](double x, double y, double z, double w) {
    return Quaternion(w, x, y, z).normalized().toRotationMatrix();
  };
  const Placement at_a{Vector3::Zero(),
                       turned(-0.41174687084982603, 0.6207481169168982, 0.5409681992251977, -0.39049929208200673)},
      at_b{{0.24813301597354298, -0.1353432742840939, 0.4317311845070303},
           turned(-0.7281412428385785, -0.034368727683152966, -0.5698611230319702, -0.3793249550078051)};
  std::vector<Contact> contacts;
  CollideShapes(a, at_a, b, at_b, 1e-2, &contacts);
  ASSERT_FALSE(contacts.empty());
  Random random(5);
  EXPECT_NEAR(LeastGap(contacts), LargestSeparation(a, at_a, b, at_b, &random), 1e-7);
}

// Bars side by side that end together touch at both ends, which keep their names whichever way they tilt.
TEST(RoundContact, FlushBarsTouchAtBothEnds) {
  const Shape bars[] = {Shape::Cylinder(0.2, 0.3), Shape::Capsule(0.2, 0.3)};
  for (const Shape& a : bars) {
    for (const Shape& b : bars) {
      for (const double angle : {0.0, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6, 1e-4, -1e-4}) {
        for (const Vector3& axis : {Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(1, 1, 0)}) {
          const Placement at_b{{0, 0.4, 0}, Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix()};
          std::vector<Contact> contacts;
          CollideShapes(a, {Vector3::Zero(), Matrix3::Identity()}, b, at_b, 0.01, &contacts);
          for (const std::uint32_t name : {1u, 2u}) {  // where the nearest points are none of these they come as well
            const auto end =
                std::find_if(contacts.begin(), contacts.end(), [&](const Contact& c) { return c.feature == name; });
            ASSERT_NE(end, contacts.end()) << angle << name;
            EXPECT_NEAR(end->point_W.z(), name == 1 ? -0.3 : 0.3, 1e-4) << angle;
          }
          EXPECT_TRUE(contacts.size() == 2 || std::abs(angle) > 1e-5) << angle;
        }
      }
    }
  }
}

// A pin at the rim of a drum ten times as wide: the same from either side, and open by as much as some direction separates the two.
TEST(RoundContact, SmallRimsAreFoundOnLargeOnes) {
  const Shape drum = Shape::Cylinder(1, 1), pin = Shape::Cylinder(0.1, 0.1);
  const auto gaps = [&](const Placement& at) {
    std::vector<Contact> one, other;
    CollideShapes(drum, {Vector3::Zero(), Matrix3::Identity()}, pin, at, 1, &one);
    CollideShapes(pin, at, drum, {Vector3::Zero(), Matrix3::Identity()}, 1, &other);
    return std::pair(LeastGap(one), LeastGap(other));
  };
  const Matrix3 turned = (Eigen::AngleAxisd(140 * std::numbers::pi / 180, Vector3::UnitZ()) *
                          Eigen::AngleAxisd(50 * std::numbers::pi / 180, Vector3::UnitX()))
                             .toRotationMatrix();
  for (const double higher : {0.0, 0.01, 0.05}) {
    const auto [one, other] = gaps({{1.0437, 0.3224, 1.0939 + higher}, turned});
    EXPECT_NEAR(one, other, 1e-12);
    EXPECT_GT(one, 0) << higher;
  }
  Random random(91);
  for (int k = 0; k < 2000; ++k) {
    const double around = random.Between(0, 6.28);
    const Vector3 rim(std::cos(around), std::sin(around), 1);
    const auto [one, other] = gaps({rim + 0.12 * random.Direction(), random.Rotation()});
    EXPECT_NEAR(one, other, 1e-9) << k;
  }
}

// A wheel beside the end of a roller has two contacts with it, which have names of their own.
TEST(RoundContact, ShortSidesHaveTwoNames) {
  const Shape roller = Shape::Cylinder(0.5, 1), wheel = Shape::Cylinder(0.5, 0.1);
  for (const double z : {0.5, 0.75, 0.85}) {
    std::vector<Contact> contacts;
    CollideShapes(roller, {Vector3::Zero(), Matrix3::Identity()}, wheel, {{1, 0, z}, Matrix3::Identity()}, 0.1,
                  &contacts);
    ASSERT_EQ(contacts.size(), 2u) << z;
    EXPECT_NE(contacts[0].feature, contacts[1].feature) << z;
  }
}

TEST(RoundContact, GapIsTheLargestSeparation) {
  Random random(3);
  const std::vector<Shape> shapes = Shapes();
  std::vector<Contact> contacts;
  int apart = 0, overlapping = 0;
  for (int trial = 0; trial < 250; ++trial) {
    const Shape &a = shapes[trial % shapes.size()], &b = shapes[3 + trial % 4 * 7 % 4];
    Placement pa{random.Direction(), random.Rotation()}, pb{pa.position_W, random.Rotation()};
    const Vector3 way = random.Direction();
    // To where the gap is what we want, a little apart or a little deep.
    const double wanted = trial % 2 ? random.Between(0, 0.2) : -random.Between(0, 0.02);
    pb.position_W = pa.position_W + 5 * way;
    for (int k = 0; k < 30; ++k) {
      contacts.clear();
      CollideShapes(a, pa, b, pb, 1e3, &contacts);
      ASSERT_FALSE(contacts.empty());
      pb.position_W -= std::min(1.0, std::max(-0.1, LeastGap(contacts) - wanted)) * way;
    }
    contacts.clear();
    CollideShapes(a, pa, b, pb, 1e3, &contacts);
    const double gap = LeastGap(contacts), largest = LargestSeparation(a, pa, b, pb, &random);
    // No direction found separates more; the contact's own separates as much (below), so nothing is claimed that is not so.
    EXPECT_GE(gap, largest - 1e-10) << "trial " << trial << ": shapes " << static_cast<int>(a.kind()) << " and "
                                    << static_cast<int>(b.kind());
    (gap < 0 ? overlapping : apart) += 1;
    for (const Contact& c : contacts) {
      EXPECT_NEAR(c.normal_W.norm(), 1, 1e-12);
      if (c.gap == gap) {
        EXPECT_NEAR(Separation(a, pa, b, pb, c.normal_W), gap, 1e-9);
      }
    }
    // The nearest points lie on both surfaces; others, of what is tilted, nearly.
    for (const Contact& c : contacts) {
      if (c.gap > gap + 0.05) continue;
      const double off = c.gap > gap + 1e-9 ? 2e-2 : 1e-9;
      EXPECT_LT(Outside(a, pa, c.point_W - 0.5 * c.gap * c.normal_W), off) << trial << ' ' << c.feature;
      EXPECT_LT(Outside(b, pb, c.point_W + 0.5 * c.gap * c.normal_W), off) << trial << ' ' << c.feature;
    }
    // The other way round it is the same, mirrored.
    std::vector<Contact> back;
    CollideShapes(b, pb, a, pa, 1e3, &back);
    EXPECT_NEAR(LeastGap(back), gap, 1e-12);
  }
  EXPECT_GT(apart, 60);
  EXPECT_GT(overlapping, 60);
}

// Where bodies lie symmetrically to each other the nearest places of a rim and of a side, or of two rims, run side by side: no normal follows
// from their directions. (Of a disc beside a lying cylinder the gap once was that of their boxes: -0.02 for 0.03.)
TEST(RoundContact, SymmetricPosesAreNoException) {
  Random random(3);
  std::vector<Matrix3> turns = {Matrix3::Identity()};
  for (const double turn : {0.5 * std::numbers::pi, 0.25 * std::numbers::pi})
    turns.push_back(Eigen::AngleAxisd(turn, Vector3::UnitX()).toRotationMatrix());
  const std::vector<Vector3> ways = {Vector3::UnitX(), Vector3::UnitY(), Vector3(1, 0, 1).normalized(),
                                     Vector3(0, 1, 0.7).normalized()};
  const std::vector<Shape> shapes = Shapes();
  for (size_t i = 0; i < shapes.size(); ++i) {
    for (size_t k = i; k < shapes.size(); ++k) {
      const Shape &a = shapes[i], &b = shapes[k];
      for (const Matrix3& turn_a : turns) {
        for (const Matrix3& turn_b : turns) {
          for (const Vector3& way : ways) {
            for (const double far : {0.85, 1.1}) {
              const Placement pa{Vector3::Zero(), turn_a},
                  pb{far * (Reach(a, turn_a, way) + Reach(b, turn_b, -way)) * way, turn_b};
              std::vector<Contact> contacts;
              CollideShapes(a, pa, b, pb, 1e3, &contacts);
              const double largest = LargestSeparation(a, pa, b, pb, &random, 3);
              EXPECT_GE(LeastGap(contacts), largest - 1e-9)
                  << static_cast<int>(a.kind()) << " and " << static_cast<int>(b.kind()) << ", " << way.transpose()
                  << " " << far << "\n"
                  << turn_a << "\n"
                  << turn_b;
            }
          }
        }
      }
    }
  }
}

// Two drums stand on each other, tilted and shifted by no more than rounding makes them: they touch all around, by columns between their ends
// that are as long as the tilt says. Where half of them were lost a column of drums fell.
TEST(RoundContact, FlushDrumsTouchAllAround) {
  constexpr double kRadius = 0.2, kHalf = 0.05;
  const Shape drum = Shape::Cylinder(kRadius, kHalf);
  for (const double tilt : {0.0, 1e-13, 1e-11, 3e-10, 1e-9, 2e-9, 1e-8, 1e-7, 1e-6}) {
    for (const double shift : {0.0, 1e-12, 1.2e-10, 4e-10, 1e-8, 1e-6}) {
      const Placement low{Vector3::Zero(), Matrix3::Identity()},
          high{{shift, 0, 2 * kHalf}, Eigen::AngleAxisd(tilt, Vector3::UnitY()).toRotationMatrix()};
      std::vector<Contact> contacts;
      CollideShapes(drum, low, drum, high, 1e-3, &contacts);
      double least_x = 0, most_x = 0, least_y = 0, most_y = 0;
      for (const Contact& c : contacts) {
        least_x = std::min(least_x, c.point_W.x()), most_x = std::max(most_x, c.point_W.x());
        least_y = std::min(least_y, c.point_W.y()), most_y = std::max(most_y, c.point_W.y());
        EXPECT_NEAR(c.gap, -tilt * (c.point_W.x() - shift), 1e-14 + 2e-6 * tilt) << tilt << " " << shift;
      }
      EXPECT_GE(contacts.size(), 8u) << tilt << " " << shift;
      for (const double far : {-least_x, most_x, -least_y, most_y})
        EXPECT_NEAR(far, kRadius, 2e-6) << tilt << " " << shift;
    }
  }
}

}  // namespace
}  // namespace islet
