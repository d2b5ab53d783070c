// The flow through the funnel, where cubes spin, wedge and part by the dozen.
#include <gtest/gtest.h>

#include "scenes/scene.h"
#include "tests/support/worlds.h"

namespace islet {
namespace {

// Of two edges that lie all but parallel each pass of the motion opened one and closed the other. Cubes were held back where the step
// began, for five frames, and one ended 9 mm deep in another.
TEST(Hourglass, NoFrameOfTheFlowFails) {
  for (const int seed : {0, 6}) {
    Settings settings;
    settings.threads = 1;
    SceneParameters parameters;
    if (seed > 0) parameters.seed = seed;
    BuiltScene scene = BuildScene(*FindScene("cubeglass"), parameters, settings);
    for (int frame = 1; frame <= 75; ++frame) {
      const StepReport report = testing::Step(&scene.world, 1.0 / 30);
      EXPECT_EQ(report.motion_failures, 0) << seed << ", frame " << frame;
      EXPECT_LE(report.penetration_max, 2.5e-4) << seed << ", frame " << frame;
    }
  }
}

}  // namespace
}  // namespace islet
