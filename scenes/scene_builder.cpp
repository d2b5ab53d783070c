#include "scenes/scene_builder.h"

#include <utility>

#include "scenes/random.h"

namespace islet {

double Grid::TopZ(int count) const {
  const int layers = (count - 1) / (per_side * per_side);
  return first_z + layers * layer_height;
}

SceneBuilder::SceneBuilder(const Scene& scene, const SceneParameters& parameters, const Settings& settings,
                           double default_friction, double default_restitution)
    : count_(parameters.count.value_or(scene.default_count)),
      friction_(parameters.friction.value_or(default_friction)),
      restitution_(parameters.restitution.value_or(default_restitution)),
      cube_(Shape::Box({0.5, 0.5, 0.5})),
      sphere_(Shape::Sphere(0.5)),
      world_(settings) {
  info_.seed = parameters.seed.value_or(scene.default_seed);
}

BodyDefinition SceneBuilder::Define(const Shape& shape, BodyKind kind, const Vector3& position_W) const {
  BodyDefinition definition{.shape = shape};
  definition.kind = kind;
  if (kind == BodyKind::kDynamic) definition.mass = 1;
  definition.position_W = position_W;
  definition.friction = friction_;
  definition.restitution = restitution_;
  return definition;
}

void SceneBuilder::AddFixedBox(const Vector3& half_extents, const Vector3& position_W, const Quaternion& rotation_WB) {
  BodyDefinition box = Define(Shape::Box(half_extents), BodyKind::kFixed, position_W);
  box.rotation_WB = rotation_WB;
  world_.Add(box);
}

void SceneBuilder::AddFixedSphere(const Vector3& position_W) {
  world_.Add(Define(sphere_, BodyKind::kFixed, position_W));
}

void SceneBuilder::AddPiece(Piece piece, const Vector3& position_W, const Quaternion& rotation_WB) {
  BodyDefinition definition = Define(piece == Piece::kCube ? cube_ : sphere_, BodyKind::kDynamic, position_W);
  definition.rotation_WB = rotation_WB;
  ++info_.bodies;
  world_.Add(definition);
}

void SceneBuilder::AddCube(const Vector3& position_W, const Quaternion& rotation_WB) {
  AddPiece(Piece::kCube, position_W, rotation_WB);
}

void SceneBuilder::AddSphere(const Vector3& position_W, const Vector3& linear_velocity_W,
                             const Vector3& angular_velocity_W) {
  BodyDefinition sphere = Define(sphere_, BodyKind::kDynamic, position_W);
  sphere.linear_velocity_W = linear_velocity_W;
  sphere.angular_velocity_W = angular_velocity_W;
  ++info_.bodies;
  world_.Add(sphere);
}

void SceneBuilder::AddFloor() {
  constexpr double kHalfWidth = 100;  // [m]
  AddFixedBox({kHalfWidth, kHalfWidth, 1}, {0, 0, -1});
  info_.bounds = Region{{-kHalfWidth, -kHalfWidth, 0}, {kHalfWidth, kHalfWidth, 1e6}};
}

void SceneBuilder::AddShaft(double half_width, double z_low, double z_high) {
  const double outer = half_width + 1;
  const double middle_z = 0.5 * (z_low + z_high);
  const double half_height = 0.5 * (z_high - z_low);
  AddFixedBox({outer, outer, 1}, {0, 0, z_low - 1});
  for (const double side : {1.0, -1.0}) {
    AddFixedBox({0.5, outer, half_height}, {side * (half_width + 0.5), 0, middle_z});
  }
  for (const double side : {1.0, -1.0}) {
    AddFixedBox({outer, 0.5, half_height}, {0, side * (half_width + 0.5), middle_z});
  }
  info_.bounds = Region{{-half_width, -half_width, z_low}, {half_width, half_width, 1e6}};
}

void SceneBuilder::AddGrid(const Grid& grid, Piece piece) {
  SplitMix64 random(seed());
  const int per_layer = grid.per_side * grid.per_side;
  const double corner = -0.5 * (grid.per_side - 1) * grid.spacing;
  for (int i = 0; i < count_; ++i) {
    const int layer = i / per_layer;
    const int row = i % per_layer / grid.per_side;
    const int column = i % grid.per_side;
    const double x = corner + column * grid.spacing + random.Uniform(-grid.jitter, grid.jitter);
    const double y = corner + row * grid.spacing + random.Uniform(-grid.jitter, grid.jitter);
    const double z = grid.first_z + layer * grid.layer_height;
    const Quaternion rotation = random.Rotation(grid.rotation);
    AddPiece(piece, {x, y, z}, rotation);
  }
}

BuiltScene SceneBuilder::Finish() { return {std::move(world_), info_}; }

}  // namespace islet
