// A world -> the text of a scene file that makes it again, bit for bit: poses, velocities, masses, inertias, materials, settings.
//
//   in:  a world, and what it does not know of itself      out: JSON, a body a line
//   rules: a rotation is written as one that is the body's once it is made one of unit length; corners of hulls are written about
//          their centre of mass, and read back to rounding; removed bodies are left out, who is frozen wakes
//   errors: std::invalid_argument that names a body whose shape is a function (Shape::Custom)
//   threads: a world that is in no step
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "engine/world.h"

namespace islet {

struct SceneCaption {
  std::string title, about, expected;
  std::uint64_t seed = 0;
  double dt = 1.0 / 30;  // [s]
  double end = 10;       // [s]
  std::optional<Region> bounds;
  std::optional<double> passed_z;
};

std::string WriteScene(const World& world, const SceneCaption& caption);

}  // namespace islet
