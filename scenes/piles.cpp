// stack, csstack, manystacks: towers of unit pieces on a floor, at rest at the start. They touch, unless a `drop` is
// given: then each piece starts that far above what is below it, and the tower builds itself as they fall.
#include <cmath>

#include "scenes/families.h"
#include "scenes/random.h"
#include "scenes/scene_builder.h"

namespace islet {
namespace {

// [m] centre of piece number `level` of a tower.
double Height(int level, const SceneParameters& parameters) {
  const double drop = parameters.drop.value_or(0);
  return 0.5 + drop + level * (1 + drop);
}

}  // namespace

BuiltScene BuildStack(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  SceneBuilder builder(scene, parameters, settings);
  builder.AddFloor();
  for (int i = 0; i < builder.count(); ++i) builder.AddCube({0, 0, Height(i, parameters)});
  return builder.Finish();
}

// Cube, sphere, cube, ... each up to a millimetre off the axis in x and in y: the tower cannot stand.
BuiltScene BuildCsStack(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  constexpr double kLargestOffset = 1e-3;  // [m]
  SceneBuilder builder(scene, parameters, settings);
  builder.AddFloor();
  SplitMix64 random(builder.seed());
  for (int i = 0; i < builder.count(); ++i) {
    const double x = random.Uniform(-kLargestOffset, kLargestOffset);
    const double y = random.Uniform(-kLargestOffset, kLargestOffset);
    if (i % 2 == 0) {
      builder.AddCube({x, y, Height(i, parameters)});
    } else {
      builder.AddSphere({x, y, Height(i, parameters)});
    }
  }
  return builder.Finish();
}

// Stacks of five on a square grid, 3 m apart, each on a floor plate of its own so that any number of them fits.
BuiltScene BuildManyStacks(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  constexpr int kHeight = 5;
  constexpr double kSpacing = 3;  // [m]
  SceneBuilder builder(scene, parameters, settings);
  const int per_side = static_cast<int>(std::ceil(std::sqrt(builder.count())));
  const double corner = -0.5 * (per_side - 1) * kSpacing;
  for (int i = 0; i < builder.count(); ++i) {
    const double x = corner + i % per_side * kSpacing;
    const double y = corner + i / per_side * kSpacing;
    builder.AddFixedBox({0.5 * kSpacing, 0.5 * kSpacing, 1}, {x, y, -1});
    for (int level = 0; level < kHeight; ++level) builder.AddCube({x, y, Height(level, parameters)});
  }
  const double edge = 0.5 * per_side * kSpacing;
  builder.info().bounds = Region{{-edge, -edge, 0}, {edge, edge, 1e6}};
  return builder.Finish();
}

}  // namespace islet
