#include "scenes/file/mesh_file.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <stdexcept>

#include "scenes/file/document.h"

namespace islet {
namespace {

constexpr size_t kMostMeshBytes = 16u << 20;

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

std::vector<Vector3> ReadMeshPoints(const std::string& path) {
  const char* const kind = EndsWith(path, ".obj") ? "obj" : EndsWith(path, ".stl") ? "stl" : nullptr;
  if (!kind) throw std::invalid_argument(path + ": the name of a mesh must end in .obj or .stl");
  const std::string bytes = ReadWholeFile(path, kMostMeshBytes, "a mesh file");
  // From memory: so a file cannot name others that would be opened.
  Assimp::Importer importer;
  const aiScene* const scene = importer.ReadFileFromMemory(bytes.data(), bytes.size(), 0, kind);
  if (!scene) throw std::invalid_argument(path + ": is no mesh that can be read: " + Shown(importer.GetErrorString()));
  std::vector<std::array<double, 3>> points;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& mesh = *scene->mMeshes[m];
    for (unsigned v = 0; v < mesh.mNumVertices; ++v)
      points.push_back({mesh.mVertices[v].x, mesh.mVertices[v].y, mesh.mVertices[v].z});
  }
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() > kMostHullPoints)
    throw std::invalid_argument(path + ": has " + std::to_string(points.size()) + " corners; a hull has at most " +
                                std::to_string(kMostHullPoints));
  std::vector<Vector3> result;
  for (const auto& [x, y, z] : points) result.emplace_back(x, y, z);
  return result;
}

}  // namespace islet
