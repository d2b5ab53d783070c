// What the paper shows, and what it warns of, on its own scenes.
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/scene.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

constexpr double kDt = 1.0 / 30;  // the paper's

Settings OneThread() {
  Settings settings;
  settings.threads = 1;
  return settings;
}

BuiltScene Build(const std::string& name, const SceneParameters& parameters, const Settings& settings) {
  return BuildScene(*FindScene(name), parameters, settings);
}

std::vector<double> SpeedsAfterOfficeToy(int count, int incoming, const Settings& settings) {
  World world = std::move(Build("officetoy", {.count = count, .incoming = incoming}, settings).world);
  for (int i = 0; i < 15; ++i) testing::Step(&world, kDt);
  std::vector<double> speeds;
  for (const Body& body : world.bodies()) {
    EXPECT_NEAR(std::hypot(body.linear_velocity_W.y(), body.linear_velocity_W.z()), 0, 1e-9);
    speeds.push_back(body.linear_velocity_W.x());
  }
  return speeds;
}

// As many as came in go out, by the priority queue.                                              [SM04 Fig. 3a]
TEST(PaperBehaviour, OfficeToyIsExactByThePriorityQueue) {
  for (const bool paper : {false, true}) {
    for (const int count : {3, 5, 10}) {
      for (const int incoming : {1, 2}) {
        Settings settings = paper ? Settings::Paper() : Settings();
        settings.threads = 1;
        settings.bounce_limit =
            incoming * (count - incoming);  // what it takes; the automatic limit is enough for one only
        const std::vector<double> speeds = SpeedsAfterOfficeToy(count, incoming, settings);
        for (int i = 0; i < count; ++i)
          EXPECT_NEAR(speeds[i], i < count - incoming ? 0 : 1, 1e-9)
              << paper << " " << count << " " << incoming << " " << i;
      }
    }
  }
}

TEST(PaperBehaviour, OfficeToyWithOneBallNeedsNoMoreThanTheAutomaticLimit) {
  for (const int count : {3, 5, 10, 40}) {
    const std::vector<double> speeds = SpeedsAfterOfficeToy(count, 1, OneThread());
    for (int i = 0; i < count; ++i) EXPECT_NEAR(speeds[i], i < count - 1 ? 0 : 1, 1e-9) << count << " " << i;
  }
}

// All at once, by the QP alone: energy and momentum are kept, the pattern is lost.               [SM04 Fig. 3b]
TEST(PaperBehaviour, OfficeToyWithoutQueueMovesAllAtOnce) {
  Settings settings = OneThread();
  settings.bounce_limit = 0;
  const std::vector<double> speeds = SpeedsAfterOfficeToy(3, 1, settings);
  EXPECT_NEAR(speeds[0], -1.0 / 3, 1e-5);
  EXPECT_NEAR(speeds[1], 2.0 / 3, 1e-5);
  EXPECT_NEAR(speeds[2], 2.0 / 3, 1e-5);
}

// Five seconds, never frozen: the tower stands in every model.
TEST(PaperBehaviour, StackStandsWithEveryModel) {
  for (const Model model : {Model::kKinetic, Model::kConvex, Model::kCoulomb}) {
    for (const Cone cone : {Cone::kCircular, Cone::kOctagon}) {
      Settings settings = OneThread();
      settings.model = model;
      settings.cone = cone;
      settings.freezing = Freezing::kOff;
      World world = std::move(Build("stack", {}, settings).world);
      const std::vector<Body> start(world.bodies().begin(), world.bodies().end());
      double deepest = 0;
      for (int i = 0; i < 150; ++i) deepest = std::max(deepest, testing::Step(&world, kDt).penetration_max);
      double drift = 0;
      for (size_t i = 0; i < start.size(); ++i)
        drift = std::max(drift, (world.bodies()[i].position_W - start[i].position_W).norm());
      EXPECT_LT(drift, 1e-3) << static_cast<int>(model) << " " << static_cast<int>(cone);
      EXPECT_LE(deepest, 2.5e-4);
    }
  }
}

TEST(PaperBehaviour, StackFreezesCompletely) {
  for (const bool paper : {false, true}) {
    Settings settings = paper ? Settings::Paper() : Settings();
    settings.threads = 1;
    World world = std::move(Build("stack", {}, settings).world);
    StepReport report;
    for (int i = 0; i < 60; ++i) report = testing::Step(&world, kDt);
    EXPECT_EQ(report.frozen, 10) << paper;
    EXPECT_EQ(report.awake, 0);
  }
}

// Cubes and spheres in turn: nothing may hold that tower up.
TEST(PaperBehaviour, TowerOfCubesAndSpheresFalls) {
  World world = std::move(Build("csstack", {}, OneThread()).world);
  const double top = 9.5;
  double fallen = 0;
  while (world.time() < 4 && fallen == 0) {
    testing::Step(&world, kDt);
    if (world.bodies().back().position_W.z() < top - 1) fallen = world.time();
  }
  EXPECT_GT(fallen, 0.3);
  EXPECT_LT(fallen, 2.5);
}

// The paper's threshold takes slowness for rest: it freezes a ball that is about to roll off. Certified freezing asks what
// holds it.                                                                                    [SM04 Sec. 5.2, Fig. 4]
TEST(PaperBehaviour, PaperFreezingHoldsUpABalancedBallAndCertifiedDoesNot) {
  for (const int freeze_count : {1, 3}) {
    Settings paper = Settings::Paper();
    paper.threads = 1;
    paper.freeze_count = freeze_count;
    World wrong = std::move(Build("balance", {.angle = 0.001}, paper).world);
    while (wrong.time() < 5) testing::Step(&wrong, kDt);
    EXPECT_TRUE(wrong.bodies().back().frozen) << freeze_count;
    EXPECT_GT(wrong.bodies().back().position_W.z(), 1.49) << freeze_count;
  }
  World right = std::move(Build("balance", {.angle = 0.001}, OneThread()).world);
  while (right.time() < 5) testing::Step(&right, kDt);
  EXPECT_LT(right.bodies().back().position_W.z(), 1);
}

TEST(PaperBehaviour, RevivalWakesTheWholeRowInTheFrameOfTheHit) {
  World world = std::move(Build("revival", {}, OneThread()).world);
  int woken = 0, frozen_before = 0;
  for (int i = 0; i < 60 && woken == 0; ++i) {
    int frozen = 0;
    for (const Body& body : world.bodies()) frozen += body.frozen;
    woken = testing::Step(&world, kDt).woken;
    if (woken) frozen_before = frozen;
  }
  EXPECT_EQ(frozen_before, 4);
  EXPECT_EQ(woken, 4);
}

// The paper's own settings stay usable end to end.
TEST(PaperBehaviour, CubejamRunsWithThePapersSettings) {
  Settings settings = Settings::Paper();
  settings.threads = 1;
  World world = std::move(Build("cubejam", {.count = 24}, settings).world);
  for (int i = 0; i < 90; ++i) {
    const StepReport report = testing::Step(&world, kDt);
    ASSERT_EQ(report.motion_failures, 0) << i;
    ASSERT_LT(report.certificate.momentum, 1e-8) << i;
  }
  for (const Body& body : world.bodies()) {
    ASSERT_TRUE(body.position_W.allFinite());
    if (body.kind == BodyKind::kDynamic) {
      EXPECT_GT(body.position_W.z(), 0);
    }
  }
}

}  // namespace
}  // namespace islet
