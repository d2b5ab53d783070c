// What the scenes are built from: floors, boxes, unit cubes and spheres, and grids of falling pieces.
//
// One builder makes one world; every body that it adds gets the same friction and restitution.
#pragma once

#include "scenes/scene.h"

namespace islet {

// Pieces in square horizontal layers, each piece shifted and turned at random.
struct Grid {
  int per_side = 1;              // pieces along x and along y
  double spacing = 1;            // [m] between centres in x and y
  double layer_height = 1;       // [m] between the centres of two layers
  double first_z = 0;            // [m] centre of the lowest layer
  double jitter = 0;             // [m] largest shift in x and in y
  double rotation = 0;           // [rad] largest turn, about an axis drawn from the unit ball
  double TopZ(int count) const;  // [m] centre of the highest layer
};

class SceneBuilder {
 public:
  SceneBuilder(const Scene& scene, const SceneParameters& parameters, const Settings& settings,
               double default_friction = 0.5, double default_restitution = 0.2);

  int count() const { return count_; }
  std::uint64_t seed() const { return info_.seed; }

  void AddFixedBox(const Vector3& half_extents, const Vector3& position_W,
                   const Quaternion& rotation_WB = Quaternion::Identity());
  void AddFixedSphere(const Vector3& position_W);
  void AddCube(const Vector3& position_W, const Quaternion& rotation_WB = Quaternion::Identity());
  void AddSphere(const Vector3& position_W, const Vector3& linear_velocity_W = Vector3::Zero(),
                 const Vector3& angular_velocity_W = Vector3::Zero());

  void AddFloor();  // 200 m x 200 m, top at z = 0; also sets the bounds
  // Four walls 1 m thick around the square |x|, |y| <= half_width, from z_low to z_high, and a floor 2 m thick below.
  void AddShaft(double half_width, double z_low, double z_high);
  // Cubes or spheres as many as count(), layer by layer from below, x fastest.
  enum class Piece { kCube, kSphere };
  void AddGrid(const Grid& grid, Piece piece);

  SceneInfo& info() { return info_; }
  BuiltScene Finish();  // the builder is empty afterwards

 private:
  void AddPiece(Piece piece, const Vector3& position_W, const Quaternion& rotation_WB);
  BodyDefinition Define(const Shape& shape, BodyKind kind, const Vector3& position_W) const;

  int count_;
  double friction_, restitution_;
  Shape cube_, sphere_;
  World world_;
  SceneInfo info_;
};

}  // namespace islet
