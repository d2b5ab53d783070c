// Whole scenes in which what a correction of overlaps leaves over decides: towers that tilt, heaps that are opened too far.
#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "scenes/scene.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

constexpr double kStep = 1.0 / 30;

BuiltScene Build(const char* name, int count, std::optional<double> drop, const Settings& settings) {
  SceneParameters parameters;
  parameters.count = count;
  parameters.drop = drop;
  return BuildScene(*FindScene(name), parameters, settings);
}

// Cubes that fall onto each other, one exactly above the other. Nothing turns them, so they stay exactly above each other.
TEST(Towers, DroppedOnesStayUprightAndComeToRest) {
  for (const double drop : {0.05, 0.11, 0.2}) {
    SCOPED_TRACE(drop);
    Settings settings;
    settings.threads = 1;
    BuiltScene scene = Build("stack", 20, drop, settings);
    const std::vector<Body> before(scene.world.bodies().begin(), scene.world.bodies().end());
    StepReport report;
    for (int frame = 0; frame < 45; ++frame) report = testing::Step(&scene.world, kStep);
    EXPECT_EQ(report.frozen, 20);
    for (size_t i = 0; i < before.size(); ++i) {
      const Vector3 moved = scene.world.body(static_cast<int>(i)).position_W - before[i].position_W;
      EXPECT_LT(moved.head<2>().norm(), 1e-6);
    }
  }
}

// Balls roll on cubes that turn: normal impulses work nothing there, so no step is cut into many pieces for the sake of energy.
TEST(Towers, FallingCubesAndSpheresAreNotCutForEnergy) {
  Settings settings;
  settings.threads = 1;
  BuiltScene scene = Build("csstack", 10, {}, settings);
  for (int frame = 0; frame < 100; ++frame) EXPECT_LE(testing::Step(&scene.world, kStep).pieces, 50) << frame;
}

// Chaotic runs are not the same with the ladder and without, but what they are on average is.
TEST(Towers, HeapsAreAsDenseWithoutTheLadder) {
  for (const char* name : {"sphereglass", "cubeglass"}) {
    SCOPED_TRACE(name);
    double contacts[2] = {0, 0}, energy[2] = {0, 0};
    for (const int off : {0, 1}) {
      Settings settings;
      settings.threads = 1;
      if (off) settings.ladder = qp::Ladder::Off();
      BuiltScene scene = Build(name, 150, {}, settings);
      for (int frame = 0; frame < 80; ++frame) {
        const StepReport report = testing::Step(&scene.world, kStep);
        contacts[off] += report.contacts;
        energy[off] += report.kinetic_energy;
      }
    }
    EXPECT_NEAR(contacts[1] / contacts[0], 1, 0.1);
    EXPECT_NEAR(energy[1] / energy[0], 1, 0.1);
  }
}

}  // namespace
}  // namespace islet
