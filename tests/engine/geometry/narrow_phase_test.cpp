#include "engine/geometry/narrow_phase.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/box_overlap.h"

namespace islet {
namespace {

using Rng = std::mt19937;

double Uniform(Rng* rng, double lower, double upper) {
  return std::uniform_real_distribution<double>(lower, upper)(*rng);
}
Vector3 RandomVector(Rng* rng, double size) {
  return {Uniform(rng, -size, size), Uniform(rng, -size, size), Uniform(rng, -size, size)};
}
Matrix3 RandomRotation(Rng* rng) {
  Eigen::Vector4d q;
  do {
    q = {Uniform(rng, -1, 1), Uniform(rng, -1, 1), Uniform(rng, -1, 1), Uniform(rng, -1, 1)};
  } while (q.norm() > 1 || q.norm() < 0.1);
  return Quaternion(q.normalized()).toRotationMatrix();
}
Placement At(double x, double y, double z) { return {{x, y, z}, Matrix3::Identity()}; }
Placement Turned(const Vector3& position, const Vector3& axis, double angle) {
  return {position, Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix()};
}
std::vector<Contact> Collide(const Shape& a, const Placement& pa, const Shape& b, const Placement& pb, double reach) {
  std::vector<Contact> contacts;
  CollideShapes(a, pa, b, pb, reach, &contacts);
  return contacts;
}
double LeastGap(const std::vector<Contact>& contacts) {
  double least = std::numeric_limits<double>::infinity();
  for (const Contact& c : contacts) least = std::min(least, c.gap);
  return least;
}
double GreatestGap(const std::vector<Contact>& contacts) {
  double greatest = -std::numeric_limits<double>::infinity();
  for (const Contact& c : contacts) greatest = std::max(greatest, c.gap);
  return greatest;
}
void ExpectNear(const Vector3& actual, const Vector3& expected, double tolerance) {
  EXPECT_LE((actual - expected).norm(), tolerance) << actual.transpose() << " against " << expected.transpose();
}
std::vector<Vector3> BoxCorners(const Vector3& half) {
  std::vector<Vector3> corners;
  for (int c = 0; c < 8; ++c) {
    corners.emplace_back((c & 1) ? half.x() : -half.x(), (c & 2) ? half.y() : -half.y(),
                         (c & 4) ? half.z() : -half.z());
  }
  return corners;
}
Shape BoxAsHull(const Vector3& half) { return Shape::ConvexHull(BoxCorners(half)); }

// [m] separation of two polytopes along a direction from a to b.
double Separation(const Polytope& a, const Placement& pa, const Polytope& b, const Placement& pb, const Vector3& n) {
  double top_a = -std::numeric_limits<double>::infinity(), bottom_b = -top_a;
  for (const Vector3& v : a.vertices) top_a = std::max(top_a, n.dot(pa.rotation_WB * v));
  for (const Vector3& v : b.vertices)
    bottom_b = std::min(bottom_b, n.dot(pb.position_W - pa.position_W + pb.rotation_WB * v));
  return bottom_b - top_a;
}

// --- spheres -----------------------------------------------------------------------------------------------------

TEST(SphereSphere, ApartAlongX) {
  const auto contacts = Collide(Shape::Sphere(1), At(0, 0, 0), Shape::Sphere(2), At(3.5, 0, 0), 1);
  ASSERT_EQ(contacts.size(), 1u);
  ExpectNear(contacts[0].normal_W, Vector3::UnitX(), 0);
  EXPECT_DOUBLE_EQ(contacts[0].gap, 0.5);
  ExpectNear(contacts[0].point_W, {1.25, 0, 0}, 1e-15);  // surfaces at 1 and 1.5
}

TEST(SphereSphere, OverlapAndOutOfReachAndConcentric) {
  auto contacts = Collide(Shape::Sphere(1), At(0, 0, 0), Shape::Sphere(1), At(0, -1.5, 0), 0);
  ASSERT_EQ(contacts.size(), 1u);
  ExpectNear(contacts[0].normal_W, -Vector3::UnitY(), 0);
  EXPECT_DOUBLE_EQ(contacts[0].gap, -0.5);
  ExpectNear(contacts[0].point_W, {0, -0.75, 0}, 1e-15);
  EXPECT_TRUE(Collide(Shape::Sphere(1), At(0, 0, 0), Shape::Sphere(1), At(3, 0, 0), 0.99).empty());
  contacts = Collide(Shape::Sphere(1), At(1, 1, 1), Shape::Sphere(1), At(1, 1, 1), 0);
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_DOUBLE_EQ(contacts[0].gap, -2);
  EXPECT_DOUBLE_EQ(contacts[0].normal_W.norm(), 1);
}

TEST(SphereHalfSpace, AboveAndBelow) {
  const Placement tilted = Turned({1, 2, 3}, {1, 0, 0}, std::acos(0.0));  // outward normal -y
  const auto contacts = Collide(Shape::HalfSpace(), tilted, Shape::Sphere(0.5), At(7, 1, -2), 1);
  ASSERT_EQ(contacts.size(), 1u);
  ExpectNear(contacts[0].normal_W, -Vector3::UnitY(), 1e-15);
  EXPECT_NEAR(contacts[0].gap, 0.5, 1e-14);
  ExpectNear(contacts[0].point_W, {7, 1.75, -2}, 1e-14);
  const auto deep = Collide(Shape::Sphere(0.5), At(0, 0, -10), Shape::HalfSpace(), At(0, 0, 0), 0);
  ASSERT_EQ(deep.size(), 1u);
  ExpectNear(deep[0].normal_W, -Vector3::UnitZ(), 0);  // from the sphere into the ground
  EXPECT_DOUBLE_EQ(deep[0].gap, -10.5);
}

TEST(BoxSphere, FaceEdgeCornerInside) {
  const Shape box = Shape::Box({1, 2, 3}), sphere = Shape::Sphere(0.5);
  auto contacts = Collide(box, At(0, 0, 0), sphere, At(0.3, 0.4, 3.75), 1);
  ASSERT_EQ(contacts.size(), 1u);
  ExpectNear(contacts[0].normal_W, Vector3::UnitZ(), 1e-15);
  EXPECT_DOUBLE_EQ(contacts[0].gap, 0.25);
  ExpectNear(contacts[0].point_W, {0.3, 0.4, 3.125}, 1e-15);

  contacts = Collide(box, At(0, 0, 0), sphere, At(1 + 0.3, 2 + 0.4, 1), 1);  // nearest: the edge at (1, 2)
  ASSERT_EQ(contacts.size(), 1u);
  ExpectNear(contacts[0].normal_W, {0.6, 0.8, 0}, 1e-14);
  EXPECT_NEAR(contacts[0].gap, 0, 1e-14);

  contacts = Collide(sphere, At(-2, -4, -5), box, At(0, 0, 0), 3);  // nearest: the corner; distance 3
  ASSERT_EQ(contacts.size(), 1u);
  ExpectNear(contacts[0].normal_W, Vector3(1, 2, 2) / 3, 1e-14);
  EXPECT_NEAR(contacts[0].gap, 2.5, 1e-14);

  contacts = Collide(box, At(0, 0, 0), sphere, At(-0.9, 0, 0), 0);  // centre inside, 0.1 below the face -x
  ASSERT_EQ(contacts.size(), 1u);
  ExpectNear(contacts[0].normal_W, -Vector3::UnitX(), 0);
  EXPECT_NEAR(contacts[0].gap, -0.6, 1e-15);
  ExpectNear(contacts[0].point_W, {-0.7, 0, 0}, 1e-15);  // between the face at -1 and the sphere's end at -0.4
}

TEST(BoxSphere, NormalIsContinuousThroughTheSurface) {
  const Shape box = Shape::Box({1, 1, 1}), sphere = Shape::Sphere(0.5);
  for (double depth : {1e-3, 1e-8, 1e-12, 1e-16, 0.0, -1e-16, -1e-12, -1e-8, -1e-3}) {
    const auto contacts = Collide(box, At(0, 0, 0), sphere, At(0.2, 0.9, 1 - depth), 0);
    ASSERT_EQ(contacts.size(), 1u);
    ExpectNear(contacts[0].normal_W, Vector3::UnitZ(), 1e-9);
    EXPECT_NEAR(contacts[0].gap, -0.5 - depth, 1e-15);
  }
}

// Two ways must agree: the closed form of the box and the search over the faces of its hull.
TEST(BoxSphere, AgreesWithTheHullOfItsCorners) {
  Rng rng(11);
  for (int trial = 0; trial < 2000; ++trial) {
    const Vector3 half(Uniform(&rng, 0.2, 2), Uniform(&rng, 0.2, 2), Uniform(&rng, 0.2, 2));
    const Placement pose{RandomVector(&rng, 3), RandomRotation(&rng)};
    const Placement centre{pose.position_W + RandomVector(&rng, 3), Matrix3::Identity()};
    const Shape sphere = Shape::Sphere(Uniform(&rng, 0.1, 1));
    const auto by_box = Collide(Shape::Box(half), pose, sphere, centre, 10);
    const auto by_hull = Collide(BoxAsHull(half), pose, sphere, centre, 10);
    ASSERT_EQ(by_box.size(), 1u);
    ASSERT_EQ(by_hull.size(), 1u);
    EXPECT_NEAR(by_box[0].gap, by_hull[0].gap, 1e-13);
    ExpectNear(by_box[0].normal_W, by_hull[0].normal_W, 1e-10);
    ExpectNear(by_box[0].point_W, by_hull[0].point_W, 1e-10);
  }
}

// --- half-space ----------------------------------------------------------------------------------------------------

TEST(BoxHalfSpace, FlatAndTilted) {
  const Shape cube = Shape::Box({0.5, 0.5, 0.5}), ground = Shape::HalfSpace();
  auto contacts = Collide(ground, At(0, 0, 0), cube, At(3, 4, 0.49), 0.1);
  ASSERT_EQ(contacts.size(), 4u);
  for (const Contact& c : contacts) {
    EXPECT_NEAR(c.gap, -0.01, 1e-15);
    EXPECT_NEAR(c.point_W.z(), -0.005, 1e-15);
    ExpectNear(c.normal_W, Vector3::UnitZ(), 0);
    EXPECT_NEAR(std::abs(c.point_W.x() - 3), 0.5, 1e-15);
    EXPECT_NEAR(std::abs(c.point_W.y() - 4), 0.5, 1e-15);
  }
  // Turned by 45 degrees about y: one edge down.
  contacts = Collide(ground, At(0, 0, 0), cube, Turned({0, 0, 1}, {0, 1, 0}, std::atan(1.0)), 0.5);
  ASSERT_EQ(contacts.size(), 2u);
  for (const Contact& c : contacts) EXPECT_NEAR(c.gap, 1 - std::sqrt(0.5), 1e-14);
  EXPECT_NE(contacts[0].feature, contacts[1].feature);
}

TEST(HullHalfSpace, Tetrahedron) {
  const Shape hull = Shape::ConvexHull(std::vector<Vector3>{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 4}});
  const auto contacts = Collide(hull, At(1, 1, 1), Shape::HalfSpace(), At(0, 0, 0), 0.5);  // its corner (0,0,0) at 0
  ASSERT_EQ(contacts.size(), 3u);
  for (const Contact& c : contacts) {
    EXPECT_NEAR(c.gap, 0, 1e-14);
    ExpectNear(c.normal_W, -Vector3::UnitZ(), 0);
  }
}

// --- boxes, by hand --------------------------------------------------------------------------------------------------

TEST(BoxBox, StackedCubesShareTheirFace) {
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  const auto contacts = Collide(cube, At(0, 0, 0), cube, At(0, 0, 1.001), 0.01);
  ASSERT_EQ(contacts.size(), 4u);
  for (const Contact& c : contacts) {
    ExpectNear(c.normal_W, Vector3::UnitZ(), 0);
    EXPECT_NEAR(c.gap, 0.001, 1e-15);
    EXPECT_NEAR(c.point_W.z(), 0.5005, 1e-15);
    EXPECT_NEAR(std::abs(c.point_W.x()), 0.5, 1e-15);
    EXPECT_NEAR(std::abs(c.point_W.y()), 0.5, 1e-15);
  }
}

TEST(BoxBox, ShiftedCubesMeetInTheCommonRectangle) {
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  const auto contacts = Collide(cube, At(0, 0, 0), cube, At(0.25, 0.75, 0.99), 0);
  ASSERT_EQ(contacts.size(), 4u);  // x in [-0.25, 0.5], y in [0.25, 0.5]
  double x_low = 1, x_high = -1, y_low = 1, y_high = -1;
  for (const Contact& c : contacts) {
    EXPECT_NEAR(c.gap, -0.01, 1e-15);
    x_low = std::min(x_low, c.point_W.x()), x_high = std::max(x_high, c.point_W.x());
    y_low = std::min(y_low, c.point_W.y()), y_high = std::max(y_high, c.point_W.y());
  }
  EXPECT_NEAR(x_low, -0.25, 1e-14);
  EXPECT_NEAR(x_high, 0.5, 1e-14);
  EXPECT_NEAR(y_low, 0.25, 1e-14);
  EXPECT_NEAR(y_high, 0.5, 1e-14);
}

TEST(BoxBox, TurnedBy45DegreesGivesAnOctagon) {
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  const auto contacts = Collide(cube, At(0, 0, 0), cube, Turned({0, 0, 1}, {0, 0, 1}, std::atan(1.0)), 0.1);
  ASSERT_EQ(contacts.size(), 8u);
  for (const Contact& c : contacts) {
    EXPECT_NEAR(c.gap, 0, 1e-15);
    EXPECT_NEAR(std::max(std::abs(c.point_W.x()), std::abs(c.point_W.y())), 0.5, 1e-14);
    EXPECT_NEAR(std::min(std::abs(c.point_W.x()), std::abs(c.point_W.y())), std::sqrt(0.5) - 0.5, 1e-14);
  }
}

TEST(BoxBox, CrossedEdgesGiveOnePoint) {
  // The upper edge of a runs along x, the lower edge of b along y; both bodies turned by 45 degrees about their edge.
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  const double r = std::sqrt(0.5);
  const auto contacts = Collide(cube, Turned({0, 0, 0}, {1, 0, 0}, std::atan(1.0)), cube,
                                Turned({0.1, 0.2, 2 * r + 0.03}, {0, 1, 0}, std::atan(1.0)), 0.1);
  ASSERT_EQ(contacts.size(), 1u);
  ExpectNear(contacts[0].normal_W, Vector3::UnitZ(), 1e-14);
  EXPECT_NEAR(contacts[0].gap, 0.03, 1e-14);
  ExpectNear(contacts[0].point_W, {0.1, 0, r + 0.015}, 1e-14);
}

TEST(BoxBox, CubeOnAWallOf70Metres) {
  Rng rng(5);
  const Shape wall = Shape::Box({35, 35, 0.5}), cube = Shape::Box({0.5, 0.5, 0.5});
  for (int trial = 0; trial < 200; ++trial) {
    const Matrix3 R = RandomRotation(&rng);
    const Vector3 centre = RandomVector(&rng, 50);
    const double gap = Uniform(&rng, -1e-3, 1e-3), x = Uniform(&rng, -34, 34), y = Uniform(&rng, -34, 34);
    const Placement on_top{centre + R * Vector3(x, y, 1 + gap),
                           R * Eigen::AngleAxisd(Uniform(&rng, 0, 3), Vector3::UnitZ()).toRotationMatrix()};
    for (bool swap : {false, true}) {
      const auto contacts =
          swap ? Collide(cube, on_top, wall, {centre, R}, 0.01) : Collide(wall, {centre, R}, cube, on_top, 0.01);
      ASSERT_EQ(contacts.size(), 4u);
      for (const Contact& c : contacts) {
        EXPECT_NEAR(c.gap, gap, 1e-13);
        ExpectNear(c.normal_W, (swap ? -1 : 1) * R.col(2), 1e-13);
        const Vector3 local = R.transpose() * (c.point_W - centre) - Vector3(x, y, 0.5 + 0.5 * gap);
        EXPECT_NEAR(local.z(), 0, 1e-13);
        EXPECT_NEAR(local.norm(), std::sqrt(0.5), 1e-12);
      }
    }
  }
}

// The top edges of two leaning cards, parallel but for 1e-8 rad: the edge lies a hair beside the other's face, and still both of
// its ends touch.
TEST(BoxBox, NearlyParallelEdgesTouchAtBothEnds) {
  const double lean = 0.5, half = 0.5, thick = 0.01, width = 0.3;
  for (const double turn : {0.0, 1e-9, -1e-8, 1e-7}) {
    const auto card = [&](double sign) -> Placement {
      const Matrix3 rotation =
          (Eigen::AngleAxisd(sign > 0 ? turn : 0, Vector3::UnitZ()) * Eigen::AngleAxisd(-sign * lean, Vector3::UnitY()))
              .toRotationMatrix();
      const double x = half * std::sin(lean) + thick * std::cos(lean);
      return {Vector3(sign * (x + 1e-7), 0, 0), rotation};
    };
    const Shape shape = Shape::Box({thick, width, half});
    const auto contacts = Collide(shape, card(-1), shape, card(1), 0.01);
    ASSERT_EQ(contacts.size(), 2u) << turn;
    EXPECT_NEAR(std::abs(contacts[0].point_W.y() - contacts[1].point_W.y()), 2 * width, 1e-3) << turn;
  }
}

TEST(BoxBox, FeaturesStayWhileTheBodiesJitter) {
  Rng rng(8);
  const Shape cube = Shape::Box({0.5, 0.5, 0.5});
  std::vector<std::uint32_t> first;
  for (int trial = 0; trial < 100; ++trial) {
    const Placement jitter = Turned(Vector3(0.3, 0.2, 1) + RandomVector(&rng, 1e-8), RandomVector(&rng, 1), 1e-8);
    std::vector<std::uint32_t> features;
    for (const Contact& c : Collide(cube, At(0, 0, 0), cube, jitter, 0.01)) features.push_back(c.feature);
    if (trial == 0) first = features;
    ASSERT_EQ(features.size(), 4u);
    EXPECT_EQ(features, first);
  }
}

// --- random pairs ---------------------------------------------------------------------------------------------------

struct RandomPair {
  Shape a, b;
  Placement pose_a, pose_b;
};

std::vector<Vector3> Cloud(Rng* rng, int count, double size) {
  std::vector<Vector3> points;
  for (int i = 0; i < count; ++i) points.push_back(RandomVector(rng, 1).cwiseProduct(Vector3::Constant(size)));
  return points;
}

Shape RandomBox(Rng* rng) {
  return Shape::Box({Uniform(rng, 0.3, 1.5), Uniform(rng, 0.3, 1.5), Uniform(rng, 0.3, 1.5)});
}

RandomPair MakePair(Rng* rng, bool hulls) {
  RandomPair pair{RandomBox(rng), RandomBox(rng), {RandomVector(rng, 2), RandomRotation(rng)}, {}};
  if (hulls) {
    pair.a = Shape::ConvexHull(Cloud(rng, 12, 1.2));
    if (Uniform(rng, 0, 1) < 0.7) pair.b = Shape::ConvexHull(Cloud(rng, 20, 1));
  }
  pair.pose_b = {pair.pose_a.position_W + RandomVector(rng, 2.2), RandomRotation(rng)};
  return pair;
}

// Greatest separation over a dense set of directions and over all the exact candidates, by supports alone.
double BestSeparation(const RandomPair& pair, Rng* rng) {
  const Polytope &a = pair.a.polytope(), &b = pair.b.polytope();
  double best = -std::numeric_limits<double>::infinity();
  auto test = [&](const Vector3& n) { best = std::max(best, Separation(a, pair.pose_a, b, pair.pose_b, n)); };
  for (const Vector3& n : a.face_normals) test(pair.pose_a.rotation_WB * n);
  for (const Vector3& n : b.face_normals) test(-(pair.pose_b.rotation_WB * n));
  for (const auto& ea : a.edges) {
    for (const auto& eb : b.edges) {
      const Vector3 n = (pair.pose_a.rotation_WB * (a.vertices[ea[1]] - a.vertices[ea[0]]))
                            .cross(pair.pose_b.rotation_WB * (b.vertices[eb[1]] - b.vertices[eb[0]]));
      if (n.norm() < 1e-9) continue;
      test(n.normalized());
      test(-n.normalized());
    }
  }
  const double by_candidates = best;
  for (int i = 0; i < 200; ++i) test(RandomVector(rng, 1).normalized());
  if (by_candidates < 0) {
    EXPECT_LE(best, by_candidates + 1e-12);  // overlapping: no direction beats the candidates
  }
  return by_candidates;
}

// [m] lower bound of the distance, by a third way: Frank-Wolfe on the difference of the bodies, supports alone.
double DistanceBound(const RandomPair& pair) {
  auto support = [](const Polytope& polytope, const Placement& pose, const Vector3& direction) {
    Vector3 best = pose.position_W + pose.rotation_WB * polytope.vertices[0];
    for (const Vector3& v : polytope.vertices) {
      const Vector3 v_W = pose.position_W + pose.rotation_WB * v;
      if (direction.dot(v_W) > direction.dot(best)) best = v_W;
    }
    return best;
  };
  Vector3 x = pair.pose_b.position_W - pair.pose_a.position_W;  // inside b - a
  double bound = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vector3 s = support(pair.b.polytope(), pair.pose_b, -x) - support(pair.a.polytope(), pair.pose_a, x);
    if (x.norm() > 1e-9) bound = std::max(bound, s.dot(x) / x.norm());
    const Vector3 step = s - x;
    if (step.squaredNorm() < 1e-20) break;
    x += std::clamp(-x.dot(step) / step.squaredNorm(), 0.0, 1.0) * step;
  }
  return bound;
}

// How a pair's contacts were found, from the top bits of the feature.
bool IsEdgePair(const Contact& contact) { return contact.feature >> 30 == 2; }
bool IsClosestPair(const Contact& contact) { return contact.feature >> 30 == 3; }

class RandomPolytopes : public ::testing::TestWithParam<bool> {};

TEST_P(RandomPolytopes, GapsAreThoseOfTheBestAxis) {
  Rng rng(GetParam() ? 21 : 22);
  int face_contacts = 0, edge_contacts = 0, closest_contacts = 0, overlaps = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    const RandomPair pair = MakePair(&rng, GetParam());
    const double separation = BestSeparation(pair, &rng);
    const double size = std::min(pair.a.size(), pair.b.size());
    const auto contacts = Collide(pair.a, pair.pose_a, pair.b, pair.pose_b, 0.3);
    if (separation > 0.3) {
      // Hulls are tested along the axes of touching features alone: apart, they may look a little nearer than they are.
      if (GetParam()) {
        EXPECT_LE(contacts.empty() ? 0 : LeastGap(contacts), 0.3);
      } else {
        EXPECT_TRUE(contacts.empty()) << "trial " << trial << " separation " << separation;
      }
      continue;
    }
    if (contacts.empty()) {  // no axis shows that they are out of reach, but they are
      EXPECT_GT(separation, 0);
      EXPECT_GT(DistanceBound(pair), 0.3 - 5e-3) << "trial " << trial;
      continue;
    }
    overlaps += separation < 0;
    ++(IsEdgePair(contacts[0]) ? edge_contacts : (IsClosestPair(contacts[0]) ? closest_contacts : face_contacts));
    const Vector3 n = contacts[0].normal_W;
    EXPECT_NEAR(n.norm(), 1, 1e-14);
    const double along = Separation(pair.a.polytope(), pair.pose_a, pair.b.polytope(), pair.pose_b, n);
    if (IsClosestPair(contacts[0]) && contacts.size() == 1) {
      EXPECT_NEAR(along, contacts[0].gap, 1e-10)
          << "trial " << trial;  // both bodies lie behind planes across their nearest points
      EXPECT_GE(along, separation - 1e-10);
    } else if (separation < 0) {
      EXPECT_NEAR(along, separation, 1.1e-4 * size) << "trial " << trial;
    } else {
      EXPECT_LE(along, separation + 1e-12);
    }
    // Kept off by the gaps, the bodies stay apart wherever else they move.
    if (separation > 1e-3 * size) {
      EXPECT_LE(LeastGap(contacts), along + 1.1e-4 * size) << "trial " << trial;
    }
    for (const Contact& c : contacts) {
      ExpectNear(c.normal_W, n, 0);
      EXPECT_GE(c.gap, along - 1e-11);  // nothing lies deeper than the extents allow
      EXPECT_LE(c.gap, 0.3);
    }
    // The two surfaces lie half a gap on either side of the point.
    for (const Contact& c : contacts) {
      const double top_a =
          -Separation(pair.a.polytope(), pair.pose_a, pair.a.polytope(), {c.point_W, Matrix3::Zero()}, n);
      EXPECT_LE(-0.5 * c.gap, top_a + 1e-12);
    }
  }
  EXPECT_GT(face_contacts, 150);
  EXPECT_GT(edge_contacts, 50);
  EXPECT_GT(closest_contacts, 10);
  EXPECT_GT(overlaps, 150);
}

TEST_P(RandomPolytopes, MovingApartByTheDepthEndsTheOverlap) {
  Rng rng(31);
  int tested = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    RandomPair pair = MakePair(&rng, GetParam());
    const auto contacts = Collide(pair.a, pair.pose_a, pair.b, pair.pose_b, 0);
    if (contacts.empty()) continue;
    const Vector3 n = contacts[0].normal_W;
    const double depth = -Separation(pair.a.polytope(), pair.pose_a, pair.b.polytope(), pair.pose_b, n);
    pair.pose_b.position_W += depth * n;
    if (!GetParam()) {
      EXPECT_NEAR(testing::BoxOverlap(pair.a.half_extents(), pair.pose_a, pair.b.half_extents(), pair.pose_b), 0, 1e-3);
    }
    EXPECT_LE(-BestSeparation(pair, &rng), 1e-12);
    ++tested;
  }
  EXPECT_GT(tested, 100);
}

// The promise of the header, for bodies that are apart: whatever b does, as long as it keeps n . displacement >= -gap
// at every contact it does not get into a, whether it slides along or comes as near as it may.
TEST_P(RandomPolytopes, KeptOffByTheirGapsTheyStayApart) {
  Rng rng(81);
  int tested = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    RandomPair pair = MakePair(&rng, GetParam());
    const double size = std::min(pair.a.size(), pair.b.size());
    if (BestSeparation(pair, &rng) <= 0) continue;
    const auto contacts = Collide(pair.a, pair.pose_a, pair.b, pair.pose_b, 0.3);
    if (contacts.empty()) continue;
    const Vector3 n = contacts[0].normal_W;
    const Vector3 start = pair.pose_b.position_W;
    for (int move = 0; move < 3; ++move) {
      const Vector3 step = RandomVector(&rng, 0.5);
      pair.pose_b.position_W = start + step - (n.dot(step) + LeastGap(contacts)) * n;
      EXPECT_LE(-BestSeparation(pair, &rng), 1.1e-4 * size) << "trial " << trial;
    }
    ++tested;
  }
  EXPECT_GT(tested, 150);
}

TEST_P(RandomPolytopes, SwappingTheBodiesFlipsTheNormal) {
  Rng rng(41);
  for (int trial = 0; trial < 2000; ++trial) {
    const RandomPair pair = MakePair(&rng, GetParam());
    const auto forth = Collide(pair.a, pair.pose_a, pair.b, pair.pose_b, 0.2);
    const auto back = Collide(pair.b, pair.pose_b, pair.a, pair.pose_a, 0.2);
    ASSERT_EQ(forth.empty(), back.empty());
    if (forth.empty()) continue;
    ASSERT_EQ(forth.size(), back.size()) << "trial " << trial;
    ExpectNear(forth[0].normal_W, -back[0].normal_W, 1e-12);
    EXPECT_NEAR(LeastGap(forth), LeastGap(back), 1e-12);
    EXPECT_NEAR(GreatestGap(forth), GreatestGap(back), 1e-12);
  }
}

TEST_P(RandomPolytopes, TurningTheWholeWorldTurnsTheContacts) {
  Rng rng(51);
  for (int trial = 0; trial < 2000; ++trial) {
    const RandomPair pair = MakePair(&rng, GetParam());
    const Matrix3 Q = RandomRotation(&rng);
    const Vector3 shift = RandomVector(&rng, 5);
    auto move = [&](const Placement& p) { return Placement{Q * p.position_W + shift, Q * p.rotation_WB}; };
    const auto here = Collide(pair.a, pair.pose_a, pair.b, pair.pose_b, 0.2);
    const auto there = Collide(pair.a, move(pair.pose_a), pair.b, move(pair.pose_b), 0.2);
    ASSERT_EQ(here.size(), there.size()) << "trial " << trial;
    for (size_t c = 0; c < here.size(); ++c) {
      ExpectNear(there[c].point_W, Q * here[c].point_W + shift, 1e-11);
      ExpectNear(there[c].normal_W, Q * here[c].normal_W, 1e-12);
      EXPECT_NEAR(there[c].gap, here[c].gap, 1e-12);
      EXPECT_EQ(there[c].feature, here[c].feature);
    }
  }
}

TEST_P(RandomPolytopes, NoPointIsRepeated) {
  Rng rng(61);
  for (int trial = 0; trial < 2000; ++trial) {
    const RandomPair pair = MakePair(&rng, GetParam());
    const auto contacts = Collide(pair.a, pair.pose_a, pair.b, pair.pose_b, 0.5);
    for (size_t i = 0; i < contacts.size(); ++i) {
      for (size_t k = 0; k < i; ++k) {
        EXPECT_GT((contacts[i].point_W - contacts[k].point_W).norm(), 1e-10);
        EXPECT_NE(contacts[i].feature, contacts[k].feature);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(BoxesAndHulls, RandomPolytopes, ::testing::Values(false, true),
                         [](const auto& parameter) { return parameter.param ? "Hulls" : "Boxes"; });

// Of round hulls few edges can carry the best axis, and the others are left out unseen: none may be missed.
TEST(RoundHulls, GapIsTheLargestSeparation) {
  Rng rng(83);
  int by_edges = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const auto ellipsoid = [&rng](const Vector3& radii) {
      std::vector<Vector3> points;
      for (int k = 0; k < 60; ++k) points.push_back(RandomVector(&rng, 1).normalized().cwiseProduct(radii));
      return Shape::ConvexHull(points);
    };
    RandomPair pair{ellipsoid({1, 1, 1}), ellipsoid({1, 0.8, 0.5}), At(3, -2, 1), {}};
    const Vector3 apart = RandomVector(&rng, 1).normalized();
    pair.pose_b = {pair.pose_a.position_W + apart, RandomRotation(&rng)};
    // Pulled apart along their centres until they overlap by a little, or are a little apart.
    const double overlap = Separation(pair.a.polytope(), pair.pose_a, pair.b.polytope(), pair.pose_b, apart);
    pair.pose_b.position_W -= (overlap - Uniform(&rng, -0.1, 0.1)) * apart;
    const double separation = BestSeparation(pair, &rng), size = std::min(pair.a.size(), pair.b.size());
    const auto contacts = Collide(pair.a, pair.pose_a, pair.b, pair.pose_b, 1);
    ASSERT_FALSE(contacts.empty());
    by_edges += IsEdgePair(contacts[0]);
    const double along =
        Separation(pair.a.polytope(), pair.pose_a, pair.b.polytope(), pair.pose_b, contacts[0].normal_W);
    if (separation > 0) {
      EXPECT_GE(LeastGap(contacts), separation - 1e-12) << "trial " << trial;
      EXPECT_NEAR(LeastGap(contacts), DistanceBound(pair), 0.02) << "trial " << trial;
    } else {
      EXPECT_NEAR(along, separation, 1.1e-4 * size) << "trial " << trial;
    }
  }
  EXPECT_GT(by_edges, 10);
}

// Two ways must agree: the box's own code and the general one on the hulls of the same corners.
TEST(BoxBox, AgreesWithTheHullsOfTheirCorners) {
  Rng rng(71);
  for (int trial = 0; trial < 2000; ++trial) {
    const RandomPair pair = MakePair(&rng, false);
    const Shape hull_a = BoxAsHull(pair.a.half_extents()), hull_b = BoxAsHull(pair.b.half_extents());
    const auto boxes = Collide(pair.a, pair.pose_a, pair.b, pair.pose_b, 0.2);
    const auto hulls = Collide(hull_a, pair.pose_a, hull_b, pair.pose_b, 0.2);
    const auto mixed = Collide(pair.a, pair.pose_a, hull_b, pair.pose_b, 0.2);
    ASSERT_EQ(boxes.size(), hulls.size()) << "trial " << trial;
    ASSERT_EQ(boxes.size(), mixed.size());
    if (boxes.empty()) continue;
    ExpectNear(boxes[0].normal_W, hulls[0].normal_W, 1e-12);
    EXPECT_NEAR(LeastGap(boxes), LeastGap(hulls), 1e-12);
    EXPECT_NEAR(GreatestGap(boxes), GreatestGap(mixed), 1e-12);
  }
}

TEST(BoxOverlap, ByHand) {
  const Vector3 half(0.5, 0.5, 0.5);
  EXPECT_NEAR(testing::BoxOverlap(half, At(0, 0, 0), half, At(0.2, 0.3, 0.9)), 0.1, 1e-15);
  EXPECT_NEAR(testing::BoxOverlap(half, At(0, 0, 0), half, At(0.2, 1.5, 0.9)), -0.5, 1e-15);
  EXPECT_NEAR(
      testing::BoxOverlap(half, At(1, 2, 3), half, Turned({1, 2, 3 + std::sqrt(0.5) + 0.4}, {0, 1, 0}, std::atan(1.0))),
      0.1, 1e-14);
}

}  // namespace
}  // namespace islet
