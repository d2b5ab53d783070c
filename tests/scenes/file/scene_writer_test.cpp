// Worlds -> files -> worlds: nothing is lost, to the last bit.
#include "scenes/file/scene_writer.h"

#include <gtest/gtest.h>

#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>

#include "scenes/file/scene_maker.h"
#include "scenes/file/scene_reader.h"
#include "scenes/random.h"
#include "scenes/scene.h"

namespace islet {
namespace {

Settings OneThread() {
  Settings settings;
  settings.threads = 1;
  return settings;
}

struct ReadBack {
  SceneDescription description;
  MadeScene made;
};

ReadBack Read(const std::string& text) {
  SceneDescription description = ReadScene(std::make_shared<const Document>("a.json", text));
  Settings settings = description.settings;
  settings.threads = 1;
  MadeScene made = MakeScene(description, settings, description.seed);
  return {std::move(description), std::move(made)};
}

SceneCaption CaptionOf(const ReadBack& read) {
  const SceneDescription& d = read.description;
  return {.title = d.title,
          .about = d.about,
          .expected = d.expected,
          .seed = d.seed,
          .dt = d.dt,
          .end = d.end,
          .bounds = d.bounds,
          .passed_z = d.passed_z};
}

TEST(SceneWriter, WritesEveryBuiltInSceneSoThatItRunsTheSame) {
  for (const Scene& scene : AllScenes()) {
    SceneParameters parameters;
    if (scene.count_changes && scene.name != "officetoy") parameters.count = 20;
    BuiltScene built = BuildScene(scene, parameters, OneThread());
    SceneCaption caption;
    caption.title = scene.name;
    caption.expected = scene.expected;
    caption.seed = built.info.seed;
    caption.bounds = built.info.bounds;
    caption.passed_z = built.info.passed_z;
    const std::string text = WriteScene(built.world, caption);
    ReadBack read = Read(text);
    EXPECT_EQ(WriteScene(read.made.world, CaptionOf(read)), text) << scene.name;
    EXPECT_EQ(read.made.info.bodies, built.info.bodies) << scene.name;
    EXPECT_EQ(read.made.info.seed, built.info.seed) << scene.name;
    EXPECT_EQ(read.made.info.smallest_size, built.info.smallest_size) << scene.name;
    EXPECT_EQ(read.made.info.passed_z, built.info.passed_z) << scene.name;
    for (int frame = 0; frame < 40; ++frame) {
      ASSERT_EQ(read.made.world.StateHash(), built.world.StateHash()) << scene.name << ", frame " << frame;
      built.world.Step(1.0 / 30);
      read.made.world.Step(read.description.dt);
    }
  }
}

TEST(SceneWriter, KeepsAllOfABody) {
  Settings settings = OneThread();
  settings.gravity = {0.1, -0.0, -1.62};
  settings.model = Model::kConvex;
  settings.cone = Cone::kOctagon;
  settings.bounce_law = BounceLaw::kEq6;
  settings.freezing = Freezing::kPaper;
  settings.bounce_limit = 7;
  settings.freeze_count = 9;
  settings.freeze_seconds = 0.3;
  settings.freeze_travel = 2e-3;
  settings.tolerance = 1.0 / 3 * 1e-3;
  settings.effort = qp::kThoroughEffort;
  settings.ladder = Ladder::Off().With(qp::Rung::kHeld);
  settings.group_bodies = 3;
  settings.touch_gap = 2e-3;
  settings.overlap_tolerance = 1.5e-4;
  settings.stateless = true;
  settings.cold_volumes = {{{-1, -2, -3}, {1, 2, 3}}};
  World world(settings);
  BodyDefinition d{.shape = Shape::Capsule(0.1, 0.7)};
  d.mass = 1.0 / 3;
  d.inertia_B = Matrix3(Vector3(0.3, 0.4, 0.5).asDiagonal());
  (*d.inertia_B)(0, 1) = (*d.inertia_B)(1, 0) = 0.01;
  d.position_W = {1e-7, 1.0 / 7, 3};
  d.rotation_WB = SplitMix64(3).Rotation(3);
  d.linear_velocity_W = {-0.0, 1, 2};
  d.angular_velocity_W = {0.1, 0.2, 0.3};
  d.friction = 0.7;
  d.restitution = 1.0 / 9;
  d.layers = 0x80000005;
  d.collides_with = 6;
  const int body = world.Add(d);
  world.SetSurfaceVelocity(body, {1, 0, 0.5});
  world.SetForce(body, {0, 0, 1}, {0, 2, 0});
  world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed, .position_W = {0, 0, -9}, .sensor = true});
  world.Add({.shape = Shape::Cylinder(1, 2),
             .kind = BodyKind::kKinematic,
             .position_W = {9, 9, 9},
             .linear_velocity_W = {1, 0, 0}});
  SceneCaption caption;
  caption.title = "a \"quoted\"\ntitle";
  const ReadBack read = Read(WriteScene(world, caption));
  EXPECT_EQ(read.description.title, "a \"quoted\"\ntitle");
  EXPECT_EQ(WriteScene(read.made.world, CaptionOf(read)), WriteScene(world, CaptionOf(read)));
  EXPECT_EQ(read.made.world.StateHash(), world.StateHash());
  const Body &a = world.body(0), &b = read.made.world.body(0);
  EXPECT_EQ(b.mass, a.mass);
  EXPECT_EQ(b.inertia_B, a.inertia_B);
  EXPECT_EQ(b.friction, a.friction);
  EXPECT_EQ(b.restitution, a.restitution);
  EXPECT_EQ(b.layers, a.layers);
  EXPECT_EQ(b.collides_with, a.collides_with);
  EXPECT_EQ(b.surface_velocity_B, a.surface_velocity_B);
  EXPECT_EQ(b.force_W, a.force_W);
  EXPECT_EQ(b.torque_W, a.torque_W);
  EXPECT_TRUE(read.made.world.body(1).sensor);
  const Settings& s = read.description.settings;
  EXPECT_EQ(s.model, settings.model);
  EXPECT_EQ(s.cone, settings.cone);
  EXPECT_EQ(s.bounce_law, settings.bounce_law);
  EXPECT_EQ(s.freezing, settings.freezing);
  EXPECT_EQ(s.bounce_limit, 7);
  EXPECT_EQ(s.freeze_count, 9);
  EXPECT_EQ(s.freeze_seconds, 0.3);
  EXPECT_EQ(s.freeze_travel, 2e-3);
  EXPECT_EQ(s.tolerance, settings.tolerance);
  EXPECT_EQ(s.effort.sweeps, settings.effort.sweeps);
  EXPECT_TRUE(s.effort.newton);
  EXPECT_TRUE(s.ladder.Has(qp::Rung::kHeld));
  EXPECT_FALSE(s.ladder.Has(qp::Rung::kSweeps));
  EXPECT_EQ(s.group_bodies, 3);
  EXPECT_EQ(s.touch_gap, 2e-3);
  EXPECT_EQ(s.overlap_tolerance, 1.5e-4);
  EXPECT_TRUE(s.stateless);
  ASSERT_EQ(s.cold_volumes.size(), 1u);
  EXPECT_EQ(s.cold_volumes[0].lower, Vector3(-1, -2, -3));
}

// A world makes rotations of unit length; one that it made must come back as it is.
TEST(SceneWriter, KeepsTheBitsOfRotations) {
  World world(OneThread());
  SplitMix64 random(11);
  for (int i = 0; i < 2000; ++i) {
    BodyDefinition d{.shape = Shape::Sphere(0.1)};
    d.position_W = {static_cast<double>(i), 0, 0};
    d.rotation_WB = random.Rotation(std::numbers::pi);
    world.Add(d);
  }
  EXPECT_EQ(Read(WriteScene(world, {})).made.world.StateHash(), world.StateHash());
}

TEST(SceneWriter, KeepsHullsToRounding) {
  World world(OneThread());
  const std::vector<Vector3> points{{0, 0, 0}, {3, 0, 0}, {0, 1, 0}, {0, 0, 0.7}};
  world.Add({.shape = Shape::ConvexHull(points), .mass = 2.0});
  const ReadBack read = Read(WriteScene(world, {}));
  const Polytope &a = world.shape(0).polytope(), &b = read.made.world.shape(0).polytope();
  ASSERT_EQ(a.vertices.size(), b.vertices.size());
  for (size_t i = 0; i < a.vertices.size(); ++i) EXPECT_LT((a.vertices[i] - b.vertices[i]).norm(), 1e-15);
  EXPECT_EQ(read.made.world.body(0).inertia_B, world.body(0).inertia_B);
}

TEST(SceneWriter, RefusesShapesThatAreFunctions) {
  World world(OneThread());
  world.Add({.shape = Shape::Custom({.half_extents = {1, 1, 1},
                                     .size = 1,
                                     .volume = 1,
                                     .inertia_per_mass = Matrix3::Identity(),
                                     .collide = [](const CustomQuery&, std::vector<Contact>*) {}})});
  EXPECT_THROW(WriteScene(world, {}), std::invalid_argument);
}

}  // namespace
}  // namespace islet
