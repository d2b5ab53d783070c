// cubejam: cubes fall into a square container 7 m wide past three beams and a block that stands on its corner.
//
//   side view         |        |    beam along x at z = 9
//                     |  <>    |    two beams along y at z = 6, x = -1.6 and 1.6, each turned by 45 degrees
//                     | <>  <> |
//                     |__<>____|    block at z = 4                                                    [SM04 Sec. 6]
#include <algorithm>
#include <numbers>

#include "engine/rotation.h"
#include "scenes/families.h"
#include "scenes/scene_builder.h"

namespace islet {

BuiltScene BuildCubejam(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  constexpr double kHalfWidth = 3.5;  // [m]
  constexpr double kWallTop = 24;     // [m]
  const Grid grid{
      .per_side = 4, .spacing = 1.45, .layer_height = 1.4, .first_z = 11.5, .jitter = 0.05, .rotation = 0.3};

  SceneBuilder builder(scene, parameters, settings);
  builder.AddShaft(kHalfWidth, 0, std::max(kWallTop, grid.TopZ(builder.count()) + 2));

  const double eighth_turn = 0.25 * std::numbers::pi;
  const Quaternion about_y = Exp(eighth_turn * Vector3::UnitY());
  const Quaternion about_x = Exp(eighth_turn * Vector3::UnitX());
  builder.AddFixedBox({0.4, kHalfWidth, 0.4}, {-1.6, 0, 6}, about_y);
  builder.AddFixedBox({0.4, kHalfWidth, 0.4}, {1.6, 0, 6}, about_y);
  builder.AddFixedBox({kHalfWidth, 0.4, 0.4}, {0, 0, 9}, about_x);
  // The block stands on a corner: a body diagonal is vertical after a turn of atan(sqrt 2), here as the reference
  // rounds it.
  const Quaternion on_corner = Exp(0.9553 * Vector3(1, 1, 0).normalized());
  builder.AddFixedBox({0.5, 0.5, 0.5}, {0, 0, 4}, on_corner);

  builder.AddGrid(grid, SceneBuilder::Piece::kCube);
  return builder.Finish();
}

}  // namespace islet
