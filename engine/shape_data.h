// What a shape knows of itself; shape.cpp makes it, snapshots carry it.
#pragma once

#include "engine/shape.h"

namespace islet {

struct Shape::Data {
  ShapeKind kind = ShapeKind::kSphere;
  double radius = 0;
  Vector3 half_extents = Vector3::Zero();
  double size = 0;
  double girth = 0;
  double half_length = 0;
  Vector3 hull_offset = Vector3::Zero();
  Polytope polytope;
  double volume = 0;
  Matrix3 inertia_per_mass = Matrix3::Zero();  // [m^2]
  std::function<void(const CustomQuery&, std::vector<Contact>*)> collide;
};

}  // namespace islet
