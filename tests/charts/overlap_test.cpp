// Overlaps and contact points of pairs whose answer is read off a drawing.
#include "bench/charts/overlap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "bench/charts/chart_plans.h"
#include "bench/charts/contact_points.h"
#include "bench/charts/polytope.h"

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;
using peers::WorldPlan;

constexpr double kExact = 1e-12;

State At(const Vector3& position, const Quaternion& rotation = Quaternion::Identity()) {
  return {.position_W = position, .rotation_WB = rotation};
}
Quaternion About(const Vector3& axis, double angle) { return Quaternion(Eigen::AngleAxisd(angle, axis)); }

BodyPlan Ball(double radius) { return {.form = BodyPlan::Form::kSphere, .radius = radius}; }

// A unit cube given as a hull.
BodyPlan CubeHull() {
  const Polytope cube = PolytopeOf(BodyPlan{}, At({0, 0, 0}));
  return {.form = BodyPlan::Form::kHull, .corners = cube.corners, .faces = cube.faces};
}

TEST(Overlap, OfCubesFaceToFace) {
  EXPECT_NEAR(PairOverlap({}, At({0, 0, 0}), {}, At({0.1, 0.2, 0.9})), 0.1, kExact);
  EXPECT_NEAR(PairOverlap({}, At({0, 0, 0}), {}, At({0, 0, 1.25})), -0.25, kExact);
}

TEST(Overlap, OfACornerInAFace) {
  // A cube on its corner reaches sqrt(3) / 2 down from its centre.
  const Quaternion on_corner = Quaternion::FromTwoVectors(Vector3(1, 1, 1), Vector3(0, 0, 1));
  const double reach = std::sqrt(3.0) / 2;
  EXPECT_NEAR(PairOverlap({}, At({0, 0, 0}), {}, At({0, 0, 0.5 + reach - 0.05}, on_corner)), 0.05, kExact);
}

TEST(Overlap, OfEdgesThatCross) {
  // Two cubes on their edges, one along x, the other along y, the edges crossing.
  const double quarter = std::numbers::pi / 4, reach = std::sqrt(0.5);
  const State low = At({0, 0, 0}, About({1, 0, 0}, quarter));
  EXPECT_NEAR(PairOverlap({}, low, {}, At({0, 0, 2 * reach - 0.03}, About({0, 1, 0}, quarter))), 0.03, kExact);
  EXPECT_LT(PairOverlap({}, low, {}, At({0, 0, 2 * reach + 0.03}, About({0, 1, 0}, quarter))), 0);
}

TEST(Overlap, OfSpheres) {
  EXPECT_NEAR(PairOverlap(Ball(0.5), At({0, 0, 0}), Ball(1), At({0, 1.2, 0})), 0.3, kExact);
  EXPECT_NEAR(PairOverlap(Ball(0.5), At({0.8, 0.8, 0}), {}, At({0, 0, 0})), 0.5 - 0.3 * std::sqrt(2.0), kExact);
  EXPECT_NEAR(PairOverlap({}, At({0, 0, 0}), Ball(0.5), At({0, 0, 0.4})), 0.6, kExact);  // its centre is inside
}

TEST(Overlap, OfHullsIsThatOfBoxes) {
  const Quaternion turn = About(Vector3(1, 2, 3).normalized(), 0.7);
  for (const Vector3& place : {Vector3(0.8, 0.1, 0.2), Vector3(0.7, 0.7, 0.3), Vector3(0.2, 0.6, -0.8)}) {
    EXPECT_NEAR(PairOverlap(CubeHull(), At({0, 0, 0}), CubeHull(), At(place, turn)),
                PairOverlap({}, At({0, 0, 0}), {}, At(place, turn)), kExact);
  }
}

TEST(Overlap, CountsEachPairOnceAndNoStaticPair) {
  WorldPlan plan{
      .bodies = {{.half_extents = {5, 5, 1}, .mass = 0}, {.half_extents = {5, 5, 1}, .mass = 0}, {}, {}, {}}};
  const std::vector<State> states = {At({0, 0, -1}), At({0, 0, -1.5}), At({0, 0, 0.4}), At({0.9, 0, 0.45}),
                                     At({3, 0, 0.5})};
  const Overlap overlap = MeasureOverlap(plan, states);
  EXPECT_EQ(overlap.pairs, 3);
  EXPECT_NEAR(overlap.deepest, 0.1, kExact);
  EXPECT_NEAR(overlap.sum, 0.1 + 0.05 + 0.1, kExact);
}

TEST(ContactPoints, FourCornersOfACubeOnAFloor) {
  const WorldPlan plan{.bodies = {{.half_extents = {5, 5, 1}, .mass = 0}, {}}};
  const std::vector<State> states = {At({0, 0, -1}), At({0, 0, 0.501})};
  std::vector<ContactPoint> points;
  AppendContacts(plan, states, 0, 1, 0.01, &points);
  ASSERT_EQ(points.size(), 4u);
  for (const ContactPoint& point : points) {
    EXPECT_NEAR(point.gap, 0.001, kExact);
    EXPECT_NEAR(point.normal_W.z(), 1, kExact);  // from the floor to the cube
    EXPECT_NEAR(std::abs(point.point_W.x()), 0.5, kExact);
    EXPECT_NEAR(std::abs(point.point_W.y()), 0.5, kExact);
  }
  AppendContacts(plan, states, 0, 1, 0.0005, &points);
  EXPECT_EQ(points.size(), 4u);  // too far apart: none added
}

TEST(ContactPoints, AreTheCommonPartOfTwoFaces) {
  const WorldPlan plan{.bodies = {{}, {}}};
  const std::vector<State> states = {At({0, 0, 0}), At({0.25, 0.5, 1})};
  std::vector<ContactPoint> points;
  AppendContacts(plan, states, 0, 1, 0.01, &points);
  double area = 0;  // of the polygon, by triangles
  for (size_t i = 1; i + 1 < points.size(); ++i) {
    area += 0.5 * (points[i].point_W - points[0].point_W).cross(points[i + 1].point_W - points[0].point_W).norm();
  }
  EXPECT_NEAR(area, 0.75 * 0.5, 1e-9);
}

TEST(ContactPoints, OnePointWhereEdgesCross) {
  const double quarter = std::numbers::pi / 4, reach = std::sqrt(0.5);
  const WorldPlan plan{.bodies = {{}, {}}};
  const std::vector<State> states = {At({0, 0, 0}, About({1, 0, 0}, quarter)),
                                     At({0.1, 0.2, 2 * reach - 0.01}, About({0, 1, 0}, quarter))};
  std::vector<ContactPoint> points;
  AppendContacts(plan, states, 0, 1, 0.01, &points);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_NEAR(points[0].gap, -0.01, kExact);
  EXPECT_NEAR(points[0].normal_W.z(), 1, kExact);
  EXPECT_NEAR((points[0].point_W - Vector3(0.1, 0, reach - 0.005)).norm(), 0, 1e-9);
}

TEST(ContactPoints, OfASpherePointToIt) {
  const WorldPlan plan{.bodies = {Ball(0.5), {}}};
  const std::vector<State> states = {At({0, 0, 0.99}), At({0, 0, 0})};
  std::vector<ContactPoint> points;
  AppendContacts(plan, states, 0, 1, 0.01, &points);
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].body_a, 1);
  EXPECT_EQ(points[0].body_b, 0);
  EXPECT_NEAR(points[0].gap, -0.01, kExact);
  EXPECT_NEAR(points[0].normal_W.z(), 1, kExact);
}

TEST(Filling, OfABrick) {
  const Polytope brick = PolytopeOf({.half_extents = {0.5, 1, 1.5}}, At({3, 2, 1}));
  const Filling filling = FillingOf(brick.corners, brick.faces);
  EXPECT_NEAR(filling.volume, 6, 1e-9);
  EXPECT_NEAR((filling.centre - Vector3(3, 2, 1)).norm(), 0, 1e-9);
  const BodyPlan plan{.half_extents = {0.5, 1, 1.5}};
  EXPECT_NEAR((filling.inertia - Matrix3(plan.Inertia().asDiagonal())).norm(), 0, 1e-9);
}

TEST(Arch, WedgesTouchEachOtherAndTheFloor) {
  const WorldPlan plan = ArchOfWedges();
  std::vector<State> states;
  for (const BodyPlan& body : plan.bodies) states.push_back(body.start);
  EXPECT_LT(MeasureOverlap(plan, states).deepest, 1e-12);
  for (int i = 1; i < static_cast<int>(plan.bodies.size()); ++i) {
    std::vector<ContactPoint> points;
    AppendContacts(plan, states, i, i + 1 < static_cast<int>(plan.bodies.size()) ? i + 1 : 0, 1e-9, &points);
    EXPECT_EQ(points.size(), 4u) << i;
  }
}

}  // namespace
}  // namespace islet::charts
