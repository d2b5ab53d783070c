// The text of a scene file -> what it says. The format: scenes/file/scene.schema.json, and the section in scenes/README.md.
//
//   in:  a document                 out: SceneDescription
//   errors: std::invalid_argument that names file, line, column, path and value; unknown keys are errors
//   limits: what document.h and json_tree.h say; kMostBodies bodies once all is repeated; hulls of kMostHullPoints points, and
//           kMostHullPointsInAll in one scene
//   files: meshes are looked for beside the scene file
//   threads: pure but for reading meshes
#pragma once

#include <memory>

#include "scenes/file/scene_description.h"
#include "scenes/scene.h"

namespace islet {

inline constexpr int kMostBodies = kMaxSceneCount;
inline constexpr size_t kMostHullPointsInAll = 20'000;
inline constexpr int kFormatVersion = 1;

SceneDescription ReadScene(std::shared_ptr<const Document> document);

}  // namespace islet
