// What `islet run` runs, ready to step: a built-in scene or one from a file.
//
//   in:  the options, checked      out: ReadyScene
//   errors: std::invalid_argument: there is no such scene, a file that says what it must not (file, line, path, value), a parameter
//           that the scene does not have
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "scenes/file/probes.h"
#include "scenes/run_options.h"
#include "scenes/scene.h"

namespace islet {

struct ReadyScene {
  std::string name;      // or the path of its file
  std::string title;     // as its file has it, or empty
  std::string about;     // what it is, may be empty
  std::string text;      // of its file, or empty
  std::string expected;  // what a right simulation shows
  double dt;             // [s] of the options, else the scene's own
  double time_limit;     // [s]
  bool stop_at_rest;
  World world;
  SceneInfo info;
  std::function<void(double time, World* world)> drive;  // to be called before each step, [s]; may be empty
  std::optional<Probes> probes;                          // to be asked after each step
};

// Whether a name is that of a file: it ends in .json or has a slash in it.
bool IsSceneFile(const std::string& name);

ReadyScene MakeReady(const RunOptions& options);

}  // namespace islet
