// Rays, moving shapes and overlaps, against formulas and against each other.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "engine/world.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

World Scene() {
  World world(testing::Awake());
  world.Add(testing::Floor());                                                             // 0
  world.Add({.shape = Shape::Sphere(0.5), .position_W = {0, 0, 2}});                       // 1
  world.Add({.shape = Shape::Box({0.5, 0.25, 1}), .position_W = {4, 0, 2}, .layers = 2});  // 2
  world.Add({.shape = Shape::ConvexHull(
                 std::vector<Vector3>{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}),
             .position_W = {8, 0, 2}});  // 3: |x| + |y| + |z| <= 1
  return world;
}

TEST(Query, RaysMeetWhatIsFirst) {
  const World world = Scene();
  const auto ball = world.CastRay({-3, 0, 2}, {10, 0, 0});
  ASSERT_TRUE(ball);
  EXPECT_EQ(ball->body, 1);
  EXPECT_NEAR(ball->share, 0.25, 1e-15);
  EXPECT_LT((ball->normal_W - Vector3(-1, 0, 0)).norm(), 1e-15);
  const auto box = world.CastRay({-3, 0, 2}, {10, 0, 0}, 2);
  ASSERT_TRUE(box);
  EXPECT_EQ(box->body, 2);
  EXPECT_NEAR(box->point_W.x(), 3.5, 1e-14);
  const auto hull = world.CastRay({8.25, 0.25, 5}, {0, 0, -6});
  ASSERT_TRUE(hull);
  EXPECT_EQ(hull->body, 3);
  EXPECT_NEAR(hull->point_W.z(), 2.5, 1e-14);
  EXPECT_LT((hull->normal_W - Vector3(1, 1, 1).normalized()).norm(), 1e-14);
  const auto floor = world.CastRay({-5, 0, 1}, {0, 0, -4});
  ASSERT_TRUE(floor);
  EXPECT_EQ(floor->body, 0);
  EXPECT_EQ(floor->share, 0.25);
  EXPECT_FALSE(world.CastRay({-5, 0, 1}, {0, 0, -0.5})) << "too short";
  EXPECT_FALSE(world.CastRay({-5, 0, 1}, {0, 0, 4})) << "away from it";
  EXPECT_FALSE(world.CastRay({-3, 0.6, 2}, {5, 0, 0})) << "past the ball";
  const auto inside = world.CastRay({0, 0, 2}, {1, 0, 0});
  ASSERT_TRUE(inside);
  EXPECT_EQ(inside->share, 0);
  EXPECT_EQ(inside->normal_W, Vector3(-1, 0, 0));
  const auto point = world.CastRay({0, 0, 2}, {0, 0, 0});
  ASSERT_TRUE(point);
  EXPECT_EQ(point->body, 1);
}

// A ray along the side of a capsule, or from a point of it, does not go in; one that comes at the seam of a cap has its normal.
TEST(Query, RaysGrazeCapsules) {
  World world(testing::Awake());
  for (const double radius : {0.5, 0.3, 0.7, 1.1}) {
    const int capsule = world.Add({.shape = Shape::Capsule(radius, 1)});
    for (double turn = 0; turn < 6; turn += 0.37) {
      const Vector3 out(std::cos(turn), std::sin(turn), 0);
      EXPECT_FALSE(world.CastRay(radius * out, {0, 0, 3})) << turn;
      EXPECT_FALSE(world.CastRay(radius * out - Vector3(0, 0, 4), {0, 0, 8})) << turn;
      const auto seam = world.CastRay((radius + 2) * out + Vector3(0, 0, 3), -4 * out - Vector3(0, 0, 4));
      ASSERT_TRUE(seam) << turn;
      EXPECT_LT((seam->normal_W - out).norm(), 1e-7) << turn;
    }
    world.Remove(capsule);
    testing::Step(&world, 0.01);
  }
}

// A tiny ball that is cast goes where a ray does.
TEST(Query, RaysAgreeWithTinyBalls) {
  const World world = Scene();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int met = 0;
  for (int i = 0; i < 400; ++i) {
    const Vector3 from(4 + 8 * uniform(random), 4 * uniform(random), 4 + 3 * uniform(random));
    const Vector3 way = Vector3(4 + 4 * uniform(random), uniform(random), 2 + uniform(random)) - from;
    const auto ray = world.CastRay(from, way);
    const auto ball = world.CastShape(Shape::Sphere(1e-5), from, Quaternion::Identity(), way);
    if (ray.has_value() != ball.has_value()) {  // only where it passes by less than the ball
      ADD_FAILURE() << from.transpose() << ", " << way.transpose();
      continue;
    }
    if (!ray) continue;
    ++met;
    EXPECT_EQ(ray->body, ball->body);
    EXPECT_NEAR(ray->share, ball->share, 1e-3);
  }
  EXPECT_GT(met, 80);
}

TEST(Query, ShapesMeetWhatIsFirst) {
  const World world = Scene();
  const auto ball = world.CastShape(Shape::Sphere(0.25), {-3, 0, 2}, Quaternion::Identity(), {10, 0, 0});
  ASSERT_TRUE(ball);
  EXPECT_EQ(ball->body, 1);
  EXPECT_NEAR(ball->share, 0.225, 1e-6);
  EXPECT_LT((ball->normal_W - Vector3(-1, 0, 0)).norm(), 1e-6);
  // An edge down, turned by 45 degrees about y: half a diagonal above the floor.
  const auto box =
      world.CastShape(Shape::Box({0.5, 0.5, 0.5}), {-5, 0, 3}, testing::Turn(M_PI / 4, Vector3::UnitY()), {0, 0, -3});
  ASSERT_TRUE(box);
  EXPECT_EQ(box->body, 0);
  EXPECT_NEAR(box->share, (3 - std::sqrt(0.5)) / 3, 1e-6);
  EXPECT_FALSE(world.CastShape(Shape::Sphere(0.25), {-3, 0.76, 2}, Quaternion::Identity(), {6, 0, 0}));
  const auto inside = world.CastShape(Shape::Sphere(0.25), {0.2, 0, 2}, Quaternion::Identity(), {1, 0, 0});
  ASSERT_TRUE(inside);
  EXPECT_EQ(inside->share, 0);
  EXPECT_EQ(inside->normal_W, Vector3(-1, 0, 0)) << "against the way";
}

// A box that flies into a face which it overlaps sideways by very little meets that face.
TEST(Query, AFaceIsMetHeadOn) {
  World world(testing::Awake());
  world.Add({.shape = Shape::Box({0.5, 0.5, 0.5}), .kind = BodyKind::kFixed});
  for (const double sideways : {1e-5, 3e-4, 1e-2}) {
    const auto hit =
        world.CastShape(Shape::Box({0.25, 0.25, 0.25}), {-3, 0.75 - sideways, 0}, Quaternion::Identity(), {5, 0, 0});
    ASSERT_TRUE(hit) << sideways;
    EXPECT_NEAR(hit->share, 0.45, 1e-6);
    EXPECT_LT((hit->normal_W - Vector3(-1, 0, 0)).norm(), 1e-9) << sideways;
  }
}

TEST(Query, OverlapsAreFound) {
  const World world = Scene();
  EXPECT_EQ(world.Overlapping(Shape::Box({6, 1, 0.1}), {4, 0, 2}, Quaternion::Identity()), (std::vector{1, 2, 3}));
  EXPECT_EQ(world.Overlapping(Shape::Box({6, 1, 0.1}), {4, 0, 2}, Quaternion::Identity(), 2), std::vector{2});
  EXPECT_EQ(world.Overlapping(Shape::Sphere(1), {-5, 0, 0.9}, Quaternion::Identity()), std::vector{0});
  EXPECT_TRUE(world.Overlapping(Shape::Sphere(1), {-5, 0, 1}, Quaternion::Identity()).empty())
      << "touching is no overlap";
}

TEST(Query, BadQuestionsAreRefused) {
  const World world = Scene();
  EXPECT_THROW(world.CastRay({0, 0, NAN}, {1, 0, 0}), std::invalid_argument);
  EXPECT_THROW(world.CastRay({0, 0, 0}, {INFINITY, 0, 0}), std::invalid_argument);
  EXPECT_THROW(world.CastShape(Shape::HalfSpace(), {0, 0, 0}, Quaternion::Identity(), {1, 0, 0}),
               std::invalid_argument);
  EXPECT_THROW(world.Overlapping(Shape::Sphere(1), {0, 0, 0}, Quaternion(2, 0, 0, 0)), std::invalid_argument);
}

// A ray that begins on a surface and leaves it has not hit it; one that goes in has, from there.
TEST(Query, RaysThatBeginOnASurface) {
  World world(testing::Awake());
  const Quaternion turned = testing::Turn(0.7, {1, 2, 3});
  world.Add({.shape = Shape::Box({0.5, 0.25, 1}), .position_W = {1, 2, 3}, .rotation_WB = turned});
  world.Add({.shape = Shape::Sphere(0.3), .position_W = {10, 0, 0}});
  world.Add({.shape = Shape::Cylinder(0.3, 1), .position_W = {20, 0, 0}});
  world.Add({.shape = Shape::Sphere(1), .position_W = {1, 2, 30}});
  const Vector3 up = turned * Vector3::UnitZ(), top = Vector3(1, 2, 3) + up, aslant = turned * Vector3(1, 0, -3);
  EXPECT_FALSE(world.CastRay(top, 5 * up));
  EXPECT_FALSE(world.CastRay(top, 5 * (turned * Vector3(1, 0, 1))));
  const auto in = world.CastRay(top, aslant);
  ASSERT_TRUE(in);
  EXPECT_LT(in->share, 1e-12);
  EXPECT_LT((in->normal_W - up).norm(), 1e-12);
  EXPECT_FALSE(world.CastRay({10.3, 0, 0}, {1, 0, 0}));
  EXPECT_FALSE(world.CastRay({10.3, 0, 0}, {0, 1, 0})) << "along it";
  EXPECT_TRUE(world.CastRay({10.3, 0, 0}, {-1, 1, 0}));
  EXPECT_FALSE(world.CastRay({20.3, 0, 0}, {1, 0, 0.5}));
  EXPECT_FALSE(world.CastRay({20, 0, 1}, {1, 0, 0.5}));
  EXPECT_TRUE(world.CastRay({20, 0, 1}, {1, 0, -0.5}));
  World floor(testing::Awake());
  floor.Add(testing::Floor());
  floor.Add({.shape = Shape::Sphere(1), .position_W = {0, 0, 5}});
  const auto above = floor.CastRay({0, 0, 0}, {0, 0, 10});
  ASSERT_TRUE(above);
  EXPECT_EQ(above->body, 1);
  EXPECT_NEAR(above->share, 0.4, 1e-15);
}

// What a ray met is where it may go on from, however small or far from the origin: rounding does not put it inside.
TEST(Query, RaysLeaveWhatTheyMet) {
  World world(testing::Awake());
  const Vector3 far(1e6, 3, 2), near(100.1, 37.3, 12.7);
  world.Add({.shape = Shape::Box({0.5, 0.5, 0.5}), .position_W = far, .rotation_WB = testing::Turn(0.7, {1, 2, 3})});
  world.Add({.shape = Shape::Sphere(5e-4), .position_W = near});
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 400; ++i) {
    const Vector3 middle = i % 2 == 0 ? far : near, from(normal(random), normal(random), normal(random));
    const Vector3 way = (i % 2 == 0 ? 3 : 2e-3) * from.normalized();
    const auto met = world.CastRay(middle + way, -way);
    ASSERT_TRUE(met) << i;
    EXPECT_FALSE(world.CastRay(met->point_W, met->normal_W)) << i;
    EXPECT_TRUE(world.CastRay(met->point_W, -met->normal_W)) << i;
  }
}

// A ball at a slant of 1e-3 to a floor: it touches where its height is used up, not where it is as deep as what is called met.
TEST(Query, ShapesMeetAtASlantAsExactly) {
  World world(testing::Awake());
  world.Add(testing::Floor());
  world.Add({.shape = Shape::Sphere(1), .position_W = {0, 50, 1}});
  const auto floor = world.CastShape(Shape::Sphere(1), {0, 0, 1.0005}, Quaternion::Identity(), {1, 0, -1e-3});
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->share, 0.5, 1e-6);
  // A ball of 0.5 m passes one of 1 m at an offset of 1.4999 m.
  const double before = std::sqrt(1.5 * 1.5 - 1.4999 * 1.4999);
  const auto ball = world.CastShape(Shape::Sphere(0.5), {-2, 50, 2.4999}, Quaternion::Identity(), {4, 0, 0});
  ASSERT_TRUE(ball);
  EXPECT_NEAR(ball->share, (2 - before) / 4, 1e-6);
}

// Half and one and a half radii beside its middle, from 100 km.
TEST(Query, RaysFromFarAwayMeetWhatIsSmall) {
  World world(testing::Awake());
  world.Add({.shape = Shape::Sphere(1e-3)});
  const Vector3 way = Vector3(1, 0.3, 0.2).normalized(), beside = way.cross(Vector3::UnitZ()).normalized();
  for (int k = 0; k < 100; ++k) {
    const Vector3 from = -(1e5 + 7 * k) * way;
    EXPECT_TRUE(world.CastRay(from + 0.5e-3 * beside, 2e5 * way + Vector3(0, 0, 0))) << k;
    EXPECT_FALSE(world.CastRay(from + 1.5e-3 * beside, 2e5 * way)) << k;
  }
}

}  // namespace
}  // namespace islet
