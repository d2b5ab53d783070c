// cubeglass, cubeglass7, sphereglass: pieces fall through a square funnel.                               [SM04 Sec. 6]
//
//      |   .  .   |      shaft |x|, |y| <= half_width, floor at z = -14, walls to z = 60 or above the highest piece
//      |\  .  .  /|      inner faces of four planks, at 60 degrees from the edge of the orifice at z = 0 up to the walls
//      | \      / |
//      |  \    /  |      z = 0, orifice |x|, |y| <= half_orifice
//      |          |
//      |__________|      z = -14
//
// The count adds or removes layers of pieces; the glass stays as it is (only its walls grow above 30 layers).
#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/rotation.h"
#include "qp/elementary.h"
#include "scenes/families.h"
#include "scenes/scene_builder.h"

namespace islet {
namespace {

constexpr double kFloorZ = -14;                        // [m]
constexpr double kWallTop = 60;                        // [m]
constexpr double kFunnelAngle = std::numbers::pi / 3;  // [rad] of the planks above the horizontal
constexpr double kPlankThickness = 1;                  // [m]
constexpr double kPlankOverlap = 0.5;                  // [m] how far a plank reaches into the wall, along its face

struct Glass {
  double half_width;    // [m]
  double half_orifice;  // [m]
  double FunnelTop() const { return (half_width - half_orifice) * Sine(kFunnelAngle) / Cosine(kFunnelAngle); }
};

constexpr Glass kWide{.half_width = 8, .half_orifice = 5};
constexpr Glass kNarrow{.half_width = 6.5, .half_orifice = 3.5};

// One plank per side. In the plane of its slope (r outwards, z up) the inner face starts at the orifice's edge and runs
// along u = (cos a, sin a); the plank lies on the other side of the inner normal n = (-sin a, cos a).
void AddFunnel(const Glass& glass, SceneBuilder* builder) {
  const double cosine = Cosine(kFunnelAngle), sine = Sine(kFunnelAngle);
  const double length = (glass.half_width - glass.half_orifice) / cosine + kPlankOverlap;
  const double r = glass.half_orifice + 0.5 * length * cosine + 0.5 * kPlankThickness * sine;
  const double z = 0.5 * length * sine - 0.5 * kPlankThickness * cosine;
  const double half_breadth = glass.half_width + 0.25;  // [m] into the walls at both ends
  for (const double side : {1.0, -1.0}) {
    const Quaternion tilt = Exp(-side * kFunnelAngle * Vector3::UnitY());
    builder->AddFixedBox({0.5 * length, half_breadth, 0.5 * kPlankThickness}, {side * r, 0, z}, tilt);
  }
  for (const double side : {1.0, -1.0}) {
    const Quaternion tilt = Exp(side * kFunnelAngle * Vector3::UnitX());
    builder->AddFixedBox({half_breadth, 0.5 * length, 0.5 * kPlankThickness}, {0, side * r, z}, tilt);
  }
}

BuiltScene BuildGlass(const Glass& glass, const Grid& grid, SceneBuilder::Piece piece, SceneBuilder builder) {
  builder.AddShaft(glass.half_width, kFloorZ, std::max(kWallTop, grid.TopZ(builder.count()) + 2));
  AddFunnel(glass, &builder);
  builder.AddGrid(grid, piece);
  builder.info().passed_z = 0;
  return builder.Finish();
}

Grid WideGrid() {
  return {.per_side = 9,
          .spacing = 1.75,
          .layer_height = 1.75,
          .first_z = kWide.FunnelTop() + 1,
          .jitter = 0.03,
          .rotation = std::numbers::pi};
}

}  // namespace

BuiltScene BuildCubeglass(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  return BuildGlass(kWide, WideGrid(), SceneBuilder::Piece::kCube, SceneBuilder(scene, parameters, settings));
}

BuiltScene BuildCubeglass7(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  const Grid grid{.per_side = 9,
                  .spacing = 1.35,
                  .layer_height = 1.3,
                  .first_z = kNarrow.FunnelTop() + 1,
                  .jitter = 0.03,
                  .rotation = 0.2};
  return BuildGlass(kNarrow, grid, SceneBuilder::Piece::kCube, SceneBuilder(scene, parameters, settings));
}

// Frictionless unless a friction is asked for.
BuiltScene BuildSphereglass(const Scene& scene, const SceneParameters& parameters, const Settings& settings) {
  return BuildGlass(kWide, WideGrid(), SceneBuilder::Piece::kSphere,
                    SceneBuilder(scene, parameters, settings, /*default_friction=*/0));
}

}  // namespace islet
