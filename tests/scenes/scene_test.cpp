#include "scenes/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "engine/geometry/narrow_phase.h"
#include "tests/support/box_overlap.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

BuiltScene Build(const std::string& name, const SceneParameters& parameters = {}, const Settings& settings = {}) {
  const Scene* scene = FindScene(name);
  if (!scene) throw std::logic_error("no scene " + name);
  return BuildScene(*scene, parameters, settings);
}

std::vector<int> BodiesOfKind(const World& world, BodyKind kind) {
  std::vector<int> numbers;
  for (size_t i = 0; i < world.bodies().size(); ++i) {
    if (world.bodies()[i].kind == kind) numbers.push_back(static_cast<int>(i));
  }
  return numbers;
}

struct FixedBox {
  const char* name;
  Vector3 centre, half_extents;
  double w, x, y, z;
};

void ExpectFixedBoxes(const World& world, const std::vector<FixedBox>& expected) {
  const std::vector<int> fixed = BodiesOfKind(world, BodyKind::kFixed);
  ASSERT_EQ(fixed.size(), expected.size());
  for (size_t i = 0; i < fixed.size(); ++i) {
    SCOPED_TRACE(expected[i].name);
    const Body& body = world.body(fixed[i]);
    const Quaternion rotation(expected[i].w, expected[i].x, expected[i].y, expected[i].z);
    EXPECT_LT((body.position_W - expected[i].centre).norm(), 1e-6);
    EXPECT_LT((world.shape(fixed[i]).half_extents() - expected[i].half_extents).norm(), 1e-6);
    EXPECT_LT((body.rotation_WB.coeffs() - rotation.coeffs()).norm(), 1e-8);
  }
}

// The reference geometry, in numbers that were worked out apart from the code.
TEST(Scene, CubeglassIsTheReferenceHourglass) {
  constexpr double kCos = 0.866025404;
  ExpectFixedBoxes(Build("cubeglass").world,
                   {
                       {"floor", {0, 0, -15}, {9, 9, 1}, 1, 0, 0, 0},
                       {"wall+x", {8.5, 0, 23}, {0.5, 9, 37}, 1, 0, 0, 0},
                       {"wall-x", {-8.5, 0, 23}, {0.5, 9, 37}, 1, 0, 0, 0},
                       {"wall+y", {0, 8.5, 23}, {9, 0.5, 37}, 1, 0, 0, 0},
                       {"wall-y", {0, -8.5, 23}, {9, 0.5, 37}, 1, 0, 0, 0},
                       {"funnel+x", {7.058013, 0, 2.564583}, {3.25, 8.25, 0.5}, kCos, 0, -0.5, 0},
                       {"funnel-x", {-7.058013, 0, 2.564583}, {3.25, 8.25, 0.5}, kCos, 0, 0.5, 0},
                       {"funnel+y", {0, 7.058013, 2.564583}, {8.25, 3.25, 0.5}, kCos, 0.5, 0, 0},
                       {"funnel-y", {0, -7.058013, 2.564583}, {8.25, 3.25, 0.5}, kCos, -0.5, 0, 0},
                   });
}

TEST(Scene, Cubeglass7IsTheNarrowHourglass) {
  constexpr double kCos = 0.866025404;
  ExpectFixedBoxes(Build("cubeglass7").world,
                   {
                       {"floor", {0, 0, -15}, {7.5, 7.5, 1}, 1, 0, 0, 0},
                       {"wall+x", {7, 0, 23}, {0.5, 7.5, 37}, 1, 0, 0, 0},
                       {"wall-x", {-7, 0, 23}, {0.5, 7.5, 37}, 1, 0, 0, 0},
                       {"wall+y", {0, 7, 23}, {7.5, 0.5, 37}, 1, 0, 0, 0},
                       {"wall-y", {0, -7, 23}, {7.5, 0.5, 37}, 1, 0, 0, 0},
                       {"funnel+x", {5.558013, 0, 2.564583}, {3.25, 6.75, 0.5}, kCos, 0, -0.5, 0},
                       {"funnel-x", {-5.558013, 0, 2.564583}, {3.25, 6.75, 0.5}, kCos, 0, 0.5, 0},
                       {"funnel+y", {0, 5.558013, 2.564583}, {6.75, 3.25, 0.5}, kCos, 0.5, 0, 0},
                       {"funnel-y", {0, -5.558013, 2.564583}, {6.75, 3.25, 0.5}, kCos, -0.5, 0, 0},
                   });
}

TEST(Scene, CubejamIsTheReferenceContainer) {
  ExpectFixedBoxes(Build("cubejam").world,
                   {
                       {"floor", {0, 0, -1}, {4.5, 4.5, 1}, 1, 0, 0, 0},
                       {"wall+x", {4, 0, 12}, {0.5, 4.5, 12}, 1, 0, 0, 0},
                       {"wall-x", {-4, 0, 12}, {0.5, 4.5, 12}, 1, 0, 0, 0},
                       {"wall+y", {0, 4, 12}, {4.5, 0.5, 12}, 1, 0, 0, 0},
                       {"wall-y", {0, -4, 12}, {4.5, 0.5, 12}, 1, 0, 0, 0},
                       {"beam1", {-1.6, 0, 6}, {0.4, 3.5, 0.4}, 0.923879533, 0, 0.382683432, 0},
                       {"beam2", {1.6, 0, 6}, {0.4, 3.5, 0.4}, 0.923879533, 0, 0.382683432, 0},
                       {"beam3", {0, 0, 9}, {3.5, 0.4, 0.4}, 0.923879533, 0.382683432, 0, 0},
                       {"block", {0, 0, 4}, {0.5, 0.5, 0.5}, 0.888077654, 0.325052366, 0.325052366, 0},
                   });
}

// The inner faces run from the edge of the orifice to the walls: seen from a plank, both ends lie on its upper face.
TEST(Scene, FunnelFacesReachFromOrificeToWall) {
  const BuiltScene built = Build("cubeglass", {.count = 1});
  const Body& plank = built.world.body(5);
  for (const Vector3& end : {Vector3(5, 0, 0), Vector3(8, 0, 3 * std::sqrt(3.0))}) {
    EXPECT_NEAR((plank.rotation_WB.conjugate() * (end - plank.position_W)).z(), 0.5, 1e-12);
  }
}

Placement PlacementOf(const Body& body) { return {body.position_W, body.rotation_WB.toRotationMatrix()}; }

// [m] by which two spheres or boxes overlap, from the poses alone.
double Overlap(const Shape& a, const Body& body_a, const Shape& b, const Body& body_b) {
  const bool sphere_a = a.kind() == ShapeKind::kSphere, sphere_b = b.kind() == ShapeKind::kSphere;
  if (sphere_a && sphere_b) return a.radius() + b.radius() - (body_a.position_W - body_b.position_W).norm();
  if (sphere_a) return Overlap(b, body_b, a, body_a);
  if (!sphere_b)
    return testing::BoxOverlap(a.half_extents(), PlacementOf(body_a), b.half_extents(), PlacementOf(body_b));
  const Vector3 centre = body_a.rotation_WB.conjugate() * (body_b.position_W - body_a.position_W);
  const Vector3 closest = centre.cwiseMax(-a.half_extents()).cwiseMin(a.half_extents());
  return b.radius() - (centre - closest).norm();
}

TEST(Scene, EverySceneStartsWithoutOverlap) {
  for (const Scene& scene : AllScenes()) {
    SCOPED_TRACE(scene.name);
    const BuiltScene built = BuildScene(scene);
    const auto bodies = built.world.bodies();
    double deepest = -1;
    for (size_t i = 0; i < bodies.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        if (bodies[i].kind == BodyKind::kFixed && bodies[j].kind == BodyKind::kFixed) continue;
        if ((bodies[i].position_W - bodies[j].position_W).norm() > bodies[i].radius + bodies[j].radius) continue;
        deepest = std::max(deepest, Overlap(built.world.shape(static_cast<int>(i)), bodies[i],
                                            built.world.shape(static_cast<int>(j)), bodies[j]));
      }
    }
    EXPECT_LT(deepest, 1e-6);  // csstack: a millimetre sideways opens or closes no gap by more
  }
}

TEST(Scene, EverySceneIsDescribed) {
  std::set<std::string_view> names;
  for (const Scene& scene : AllScenes()) {
    SCOPED_TRACE(scene.name);
    EXPECT_TRUE(names.insert(scene.name).second);
    EXPECT_EQ(FindScene(scene.name), &scene);
    EXPECT_FALSE(scene.summary.empty());
    EXPECT_FALSE(scene.expected.empty());
    EXPECT_GT(scene.time_limit, 0);
    const BuiltScene built = BuildScene(scene);
    const std::vector<int> dynamic = BodiesOfKind(built.world, BodyKind::kDynamic);
    EXPECT_EQ(built.info.bodies, static_cast<int>(dynamic.size()));
    for (const int body : dynamic) {
      EXPECT_EQ(built.world.body(body).mass, 1);
      EXPECT_GE(built.world.shape(body).size(), built.info.smallest_size);
      if (!built.info.bounds) continue;
      EXPECT_TRUE((built.world.body(body).position_W.array() > built.info.bounds->lower.array()).all());
      EXPECT_TRUE((built.world.body(body).position_W.array() < built.info.bounds->upper.array()).all());
    }
  }
  EXPECT_EQ(names.size(), 10u);
}

TEST(Scene, CountAddsAndRemovesBodies) {
  for (const Scene& scene : AllScenes()) {
    if (!scene.count_changes) continue;
    SCOPED_TRACE(scene.name);
    const int standard = BuildScene(scene).info.bodies;
    const int per_piece = scene.name == "manystacks" ? 5 : 1;
    for (const int change : {-1, 3}) {
      const BuiltScene built = BuildScene(scene, {.count = scene.default_count + change});
      EXPECT_EQ(built.info.bodies, standard + change * per_piece);
    }
  }
}

TEST(Scene, MoreCubesKeepTheGlassAndStayInside) {
  const BuiltScene reference = Build("cubeglass");
  const BuiltScene larger = Build("cubeglass", {.count = 3000});
  for (int i : {0, 5, 6, 7, 8}) {  // floor and funnel
    EXPECT_EQ(larger.world.body(i).position_W, reference.world.body(i).position_W);
  }
  const Body& wall = larger.world.body(1);
  const double top = wall.position_W.z() + larger.world.shape(1).half_extents().z();
  for (const int body : BodiesOfKind(larger.world, BodyKind::kDynamic)) {
    EXPECT_LT(larger.world.body(body).position_W.z() + larger.world.body(body).radius, top);
  }
  // The first thousand are the same cubes.
  EXPECT_EQ(larger.world.body(1000).position_W, reference.world.body(1000).position_W);
}

TEST(Scene, SeedDecidesThePlacementOfRandomScenes) {
  for (const Scene& scene : AllScenes()) {
    SCOPED_TRACE(scene.name);
    const std::uint64_t standard = BuildScene(scene).world.StateHash();
    EXPECT_EQ(BuildScene(scene, {.seed = scene.default_seed}).world.StateHash(), standard);
    const std::uint64_t other = BuildScene(scene, {.seed = scene.default_seed + 1}).world.StateHash();
    EXPECT_EQ(other != standard, scene.default_seed != 0);
  }
}

TEST(Scene, CoefficientsReachEveryBody) {
  for (const Scene& scene : AllScenes()) {
    SCOPED_TRACE(scene.name);
    const BuiltScene built = BuildScene(scene, {.friction = 0.375, .restitution = 0.625});
    for (const Body& body : built.world.bodies()) {
      EXPECT_EQ(body.friction, 0.375);
      EXPECT_EQ(body.restitution, 0.625);
    }
  }
  const BuiltScene glass = Build("sphereglass"), toy = Build("officetoy");  // outlive the spans
  for (const Body& body : glass.world.bodies()) EXPECT_EQ(body.friction, 0);
  for (const Body& body : toy.world.bodies()) EXPECT_EQ(body.restitution, 1);
}

TEST(Scene, CsStackAlternatesWithinAMillimetre) {
  const BuiltScene built = Build("csstack");
  double farthest = 0;
  int level = 0;
  for (const int body : BodiesOfKind(built.world, BodyKind::kDynamic)) {
    EXPECT_EQ(built.world.shape(body).kind(), level % 2 == 0 ? ShapeKind::kBox : ShapeKind::kSphere);
    EXPECT_EQ(built.world.body(body).position_W.z(), 0.5 + level++);
    farthest = std::max(farthest, built.world.body(body).position_W.head<2>().cwiseAbs().maxCoeff());
  }
  EXPECT_LE(farthest, 1e-3);
  EXPECT_GT(farthest, 1e-4);
}

TEST(Scene, OfficeToyIsWeightlessAndLetsSomeFlyIn) {
  const BuiltScene built = Build("officetoy", {.count = 7, .incoming = 3});
  EXPECT_EQ(built.world.settings().gravity, Vector3(0, 0, 0));
  for (int i = 0; i < 7; ++i) {
    EXPECT_EQ(built.world.body(i).linear_velocity_W, Vector3(i < 3 ? 1 : 0, 0, 0));
    EXPECT_NEAR(built.world.body(i).position_W.x(), i < 3 ? i - 0.1 : i, 1e-15);
  }
}

TEST(Scene, BalanceStartsAtItsAngle) {
  const BuiltScene built = Build("balance", {.angle = 0.25});
  const Vector3 apart = built.world.body(2).position_W - built.world.body(1).position_W;
  EXPECT_NEAR(apart.norm(), 1, 1e-15);
  EXPECT_NEAR(std::atan2(apart.x(), apart.z()), 0.25, 1e-15);
}

// Every piece of a tower starts the drop above what is below it; without one nothing is different.
TEST(Scene, DropLeavesGapsInTheTowers) {
  for (const auto& [name, height] : {std::pair("stack", 10), std::pair("csstack", 10), std::pair("manystacks", 5)}) {
    SCOPED_TRACE(name);
    const BuiltScene touching = Build(name);
    const BuiltScene open = Build(name, {.drop = 0.25});
    const std::vector<int> pieces = BodiesOfKind(open.world, BodyKind::kDynamic);
    ASSERT_EQ(pieces, BodiesOfKind(touching.world, BodyKind::kDynamic));
    for (size_t i = 0; i < pieces.size(); ++i) {
      const double lift = 0.25 * (1 + static_cast<double>(i % height));
      const Vector3 expected = touching.world.body(pieces[i]).position_W + Vector3(0, 0, lift);
      EXPECT_LT((open.world.body(pieces[i]).position_W - expected).norm(), 1e-12);
    }
    EXPECT_EQ(Build(name, {.drop = 0}).world.StateHash(), touching.world.StateHash());
  }
}

TEST(Scene, DroppedCubesMakeAStack) {
  Settings settings;
  settings.threads = 1;
  BuiltScene built = Build("stack", {.count = 3, .drop = 0.3}, settings);
  EXPECT_TRUE(built.world.contacts().empty());
  for (int frame = 0; frame < 150; ++frame) testing::Step(&built.world, 1.0 / 30);
  for (int i = 0; i < 3; ++i) {
    const Vector3 position = built.world.body(1 + i).position_W;
    EXPECT_NEAR(position.z(), 0.5 + i, 5e-3);
    EXPECT_LT(position.head<2>().norm(), 0.2);  // corners bounce one after the other, so the cubes land a little turned
    EXPECT_TRUE(built.world.body(1 + i).frozen);
  }
}

TEST(Scene, NearestNameIsSuggested) {
  EXPECT_EQ(FindScene("cubeglas"), nullptr);
  EXPECT_EQ(NearestScene("cubeglas"), "cubeglass");
  EXPECT_EQ(NearestScene("many_stacks"), "manystacks");
  EXPECT_EQ(NearestScene("staxk"), "stack");
}

void ExpectRejected(const std::string& scene, const SceneParameters& parameters, const std::string& field,
                    const std::string& value) {
  SCOPED_TRACE(scene + " " + field);
  try {
    Build(scene, parameters);
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find(field), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find(value), std::string::npos) << error.what();
  }
}

TEST(Scene, BadParametersAreNamedWithTheirValue) {
  ExpectRejected("stack", {.count = 0}, "count", "0");
  ExpectRejected("stack", {.count = -4}, "count", "-4");
  ExpectRejected("stack", {.count = 1'000'001}, "count", "1000001");
  ExpectRejected("balance", {.count = 2}, "count", "2");
  ExpectRejected("cubejam", {.friction = -0.5}, "friction", "-0.5");
  ExpectRejected("cubejam", {.friction = kNan}, "friction", "nan");
  ExpectRejected("cubejam", {.friction = std::numeric_limits<double>::infinity()}, "friction", "inf");
  ExpectRejected("csstack", {.restitution = 1.25}, "restitution", "1.25");
  ExpectRejected("csstack", {.restitution = kNan}, "restitution", "nan");
  ExpectRejected("stack", {.drop = -0.25}, "drop", "-0.25");
  ExpectRejected("manystacks", {.drop = 100.5}, "drop", "100.5");
  ExpectRejected("csstack", {.drop = kNan}, "drop", "nan");
  ExpectRejected("cubeglass", {.drop = 0.5}, "drop", "0.5");
  ExpectRejected("balance", {.angle = kNan}, "angle", "nan");
  ExpectRejected("stack", {.angle = 0.5}, "angle", "0.5");
  ExpectRejected("officetoy", {.incoming = 5}, "incoming", "5");
  ExpectRejected("officetoy", {.incoming = 0}, "incoming", "0");
  ExpectRejected("stack", {.incoming = 1}, "incoming", "1");
}

}  // namespace
}  // namespace islet
