// Why islet has a narrow phase of its own. Each test runs an input on which FCL has been reported wrong through both:
// what FCL 0.7 does here is printed and recorded, never judged; what ours does is.
#include <cmath>
#include <cstdio>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <fcl/narrowphase/collision.h>
#include <gtest/gtest.h>

#include "engine/narrow_phase.h"

namespace islet {
namespace {

struct Body {
  Shape shape;
  std::shared_ptr<fcl::CollisionGeometryd> geometry;
  Placement pose;
};

Body Box(const Vector3& half, const Placement& pose) {
  return {Shape::Box(half), std::make_shared<fcl::Boxd>(2 * half.x(), 2 * half.y(), 2 * half.z()), pose};
}
Body Sphere(double radius, const Placement& pose) {
  return {Shape::Sphere(radius), std::make_shared<fcl::Sphered>(radius), pose};
}

Placement At(double x, double y, double z) { return {{x, y, z}, Matrix3::Identity()}; }

std::vector<Contact> Ours(const Body& a, const Body& b, double reach = 0) {
  std::vector<Contact> contacts;
  CollideShapes(a.shape, a.pose, b.shape, b.pose, reach, &contacts);
  return contacts;
}

std::vector<fcl::Contactd> Fcl(const Body& a, const Body& b) {
  auto object = [](const Body& body) {
    fcl::Transform3d transform = fcl::Transform3d::Identity();
    transform.linear() = body.pose.rotation_WB;
    transform.translation() = body.pose.position_W;
    return fcl::CollisionObjectd(body.geometry, transform);
  };
  const fcl::CollisionRequestd request(16, true);
  fcl::CollisionResultd result;
  const fcl::CollisionObjectd object_a = object(a), object_b = object(b);
  fcl::collide(&object_a, &object_b, request, result);
  std::vector<fcl::Contactd> contacts;
  result.getContacts(contacts);
  return contacts;
}

void Record(const std::string& name, const std::vector<fcl::Contactd>& contacts) {
  std::printf("FCL, %s: %zu contacts\n", name.c_str(), contacts.size());
  for (const fcl::Contactd& c : contacts) {
    std::printf("  point (% .6f % .6f % .6f) normal (% .6f % .6f % .6f) depth % .9f\n", c.pos.x(), c.pos.y(), c.pos.z(),
                c.normal.x(), c.normal.y(), c.normal.z(), c.penetration_depth);
  }
  testing::Test::RecordProperty("fcl_contacts_" + name, static_cast<int>(contacts.size()));
}

size_t DistinctPoints(const std::vector<Vector3>& points) {
  size_t distinct = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    bool repeated = false;
    for (size_t k = 0; k < i; ++k) repeated = repeated || (points[i] - points[k]).norm() < 1e-9;
    distinct += !repeated;
  }
  return distinct;
}

// fcl#422: the normal flips while the bodies hardly move.
TEST(FclFaults, NormalsThatFlip) {
  int fcl_flips = 0, fcl_missing = 0;
  Vector3 previous = Vector3::Zero();
  for (int step = 0; step < 400; ++step) {
    const double t = 1e-9 * step;
    const Body a = Box({1, 1, 0.05}, At(0, 0, 0));
    const Body b = Box({0.05, 0.05, 0.05}, {{0.3 + t, 0.2 - t, 0.0999}, Eigen::AngleAxisd(t, Vector3::UnitX()).toRotationMatrix()});
    const auto fcl_contacts = Fcl(a, b);
    fcl_missing += fcl_contacts.empty();
    for (const fcl::Contactd& c : fcl_contacts) {
      fcl_flips += step > 0 && previous.dot(c.normal) < 0;
      previous = c.normal;
    }
    const auto contacts = Ours(a, b);
    ASSERT_EQ(contacts.size(), 4u);
    for (const Contact& c : contacts) {
      EXPECT_LE((c.normal_W - Vector3::UnitZ()).norm(), 1e-6);
      EXPECT_NEAR(c.gap, -1e-4, 1e-7);
    }
  }
  std::printf("FCL: %d flips and %d missed contacts over 400 nudges of a box on a plate\n", fcl_flips, fcl_missing);
  RecordProperty("fcl_flips", fcl_flips);
}

// The same for spheres: the order of the arguments must flip the normal and nothing else.
TEST(FclFaults, NormalPointsFromFirstToSecond) {
  const Body box = Box({0.5, 0.5, 0.5}, At(0, 0, 0)), sphere = Sphere(0.5, At(0.1, 0.2, 0.9));
  Record("box_then_sphere", Fcl(box, sphere));
  Record("sphere_then_box", Fcl(sphere, box));
  const auto forth = Ours(box, sphere), back = Ours(sphere, box);
  ASSERT_EQ(forth.size(), 1u);
  ASSERT_EQ(back.size(), 1u);
  EXPECT_LE((forth[0].normal_W - Vector3::UnitZ()).norm(), 1e-15);
  EXPECT_LE((back[0].normal_W + Vector3::UnitZ()).norm(), 1e-15);
  EXPECT_NEAR(forth[0].gap, -0.1, 1e-15);
  EXPECT_LE((forth[0].point_W - back[0].point_W).norm(), 1e-15);
}

// fcl#76: point and normal of a box and a sphere, at a face, at an edge, and with the centre inside the box.
TEST(FclFaults, BoxAndSphere) {
  const Body box = Box({1, 1, 1}, At(0, 0, 0));
  struct Case {
    const char* name;
    Vector3 centre, point, normal;
    double gap;
  };
  const double r = std::sqrt(0.5);
  const std::vector<Case> cases = {
      {"face", {0.2, 0.3, 1.4}, {0.2, 0.3, 0.95}, {0, 0, 1}, -0.1},
      {"edge", {1 + 0.4 * r, 0.3, 1 + 0.4 * r}, {1 - 0.05 * r, 0.3, 1 - 0.05 * r}, {r, 0, r}, -0.1},
      {"centre_inside", {0.2, 0.3, 0.9}, {0.2, 0.3, 0.7}, {0, 0, 1}, -0.6},
      {"centre_in_the_middle", {0.0, 0.0, 0.0}, {0.25, 0, 0}, {1, 0, 0}, -1.5},
  };
  for (const Case& expected : cases) {
    const Body sphere = Sphere(0.5, {expected.centre, Matrix3::Identity()});
    Record(std::string("box_sphere_") + expected.name, Fcl(box, sphere));
    const auto contacts = Ours(box, sphere);
    ASSERT_EQ(contacts.size(), 1u) << expected.name;
    EXPECT_LE((contacts[0].normal_W - expected.normal).norm(), 1e-14) << expected.name;
    EXPECT_LE((contacts[0].point_W - expected.point).norm(), 1e-14) << expected.name;
    EXPECT_NEAR(contacts[0].gap, expected.gap, 1e-14) << expected.name;
  }
}

// fcl#106, #128: points where the bodies do not touch, and the same point several times.
TEST(FclFaults, GhostAndRepeatedPoints) {
  const std::vector<std::pair<std::string, Placement>> cases = {
      {"aligned", At(0, 0, 0.999)},
      {"shifted", At(0.3, -0.4, 0.999)},
      {"corner_only", At(0.999, 0.999, 0.999)},
      {"turned", {{0, 0, 0.999}, Eigen::AngleAxisd(std::atan(1.0), Vector3::UnitZ()).toRotationMatrix()}},
      {"apart", At(0, 0, 1.001)}};
  for (const auto& [name, pose] : cases) {
    const Body a = Box({0.5, 0.5, 0.5}, At(0, 0, 0)), b = Box({0.5, 0.5, 0.5}, pose);
    const auto fcl_contacts = Fcl(a, b);
    Record("cubes_" + name, fcl_contacts);
    std::vector<Vector3> fcl_points, points;
    for (const fcl::Contactd& c : fcl_contacts) fcl_points.push_back(c.pos);
    RecordProperty("fcl_distinct_" + name, static_cast<int>(DistinctPoints(fcl_points)));
    const auto contacts = Ours(a, b);
    EXPECT_EQ(contacts.size(), name == "apart" ? 0u : (name == "turned" ? 8u : 4u));
    for (const Contact& c : contacts) {
      points.push_back(c.point_W);
      // Inside both cubes: half an overlap below each surface.
      const Vector3 in_b = pose.rotation_WB.transpose() * (c.point_W - pose.position_W);
      EXPECT_LE(c.point_W.cwiseAbs().maxCoeff(), 0.5 + 1e-12) << name;
      EXPECT_LE(in_b.cwiseAbs().maxCoeff(), 0.5 + 1e-12) << name;
      EXPECT_NEAR(c.gap, -0.001, 1e-14);
    }
    EXPECT_EQ(DistinctPoints(points), points.size());
  }
}

// Fewer than four points for a face that rests on a face: the body would rock.
TEST(FclFaults, FaceContactsNeedTheirCorners) {
  int fcl_fewer = 0, cases = 0;
  for (int step = 0; step < 200; ++step) {
    const double angle = 0.01 * step, x = 0.3 * std::sin(1.0 * step), y = 0.3 * std::cos(2.0 * step);
    const Body plate = Box({35, 35, 0.5}, At(0, 0, -0.5));
    const Body cube = Box({0.5, 0.5, 0.5}, {{x, y, 0.4999}, Eigen::AngleAxisd(angle, Vector3::UnitZ()).toRotationMatrix()});
    std::vector<Vector3> fcl_points;
    for (const fcl::Contactd& c : Fcl(plate, cube)) fcl_points.push_back(c.pos);
    fcl_fewer += DistinctPoints(fcl_points) < 4;
    ++cases;
    const auto contacts = Ours(plate, cube);
    ASSERT_EQ(contacts.size(), 4u);
    for (const Contact& c : contacts) {
      const Vector3 in_cube = cube.pose.rotation_WB.transpose() * (c.point_W - cube.pose.position_W);
      EXPECT_NEAR(std::abs(in_cube.x()), 0.5, 1e-13);
      EXPECT_NEAR(std::abs(in_cube.y()), 0.5, 1e-13);
      EXPECT_NEAR(c.gap, -1e-4, 1e-13);
    }
  }
  std::printf("FCL: fewer than four distinct points in %d of %d poses of a cube on a plate\n", fcl_fewer, cases);
  RecordProperty("fcl_fewer_than_four", fcl_fewer);
}

}  // namespace
}  // namespace islet
