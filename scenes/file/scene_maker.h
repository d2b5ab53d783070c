// What a scene file says -> a world ready to step, and who is who in it.
//
//   in:  a description, engine settings (those of the file, or what the command line made of them)      out: MadeScene
//   errors: std::invalid_argument that names the place in the file: bodies that overlap, a mass that no body has
//   threads: pure
#pragma once

#include <map>
#include <string>
#include <vector>

#include "scenes/file/scene_description.h"
#include "scenes/scene.h"

namespace islet {

struct MadeScene {
  World world;
  SceneInfo info;
  std::map<std::string, std::vector<int>> named;  // bodies of each name, ascending
};

MadeScene MakeScene(const SceneDescription& description, const Settings& settings, std::uint64_t seed);

// Bodies that a drive or a probe means.
std::vector<int> ChosenBodies(const MadeScene& made, const BodyChoice& choice);

}  // namespace islet
