// The corners of a mesh file, of which a hull is made: Wavefront .obj or .stl, as text or binary.
//
//   in:  a file of at most 16 MiB      out: its points, each once, ascending by x, y, z; in the units of the file
//   errors: std::invalid_argument that names the file; nothing beside the file is opened (no .mtl)
//   threads: any
#pragma once

#include <string>
#include <vector>

#include "engine/linear_algebra.h"

namespace islet {

inline constexpr size_t kMostHullPoints = 2000;  // of one shape: a hull of that many takes 0.3 s

std::vector<Vector3> ReadMeshPoints(const std::string& path);

}  // namespace islet
