// `islet export`: a built-in scene as a scene file. `islet check`: whether scene files are right, without running them.
//
//   errors: std::invalid_argument for a bad option or a scene too large for a file; std::runtime_error for an output that cannot be
//           written
#pragma once

#include <string>
#include <vector>

#include "scenes/scene.h"

namespace CLI {
class App;
}

namespace islet {

struct ExportOptions {
  std::string scene;
  SceneParameters parameters;
  std::string out;  // file; empty: the standard output
};

void AddExportOptions(CLI::App* command, ExportOptions* options);
void ExportScene(const ExportOptions& options);

struct CheckFilesOptions {
  std::vector<std::string> files;
};

void AddCheckFilesOptions(CLI::App* command, CheckFilesOptions* options);
// A line for each on the standard output if it is right, else on the standard error. False if any is not.
bool CheckSceneFiles(const CheckFilesOptions& options);

// Where the samples lie: below share/ of where the program is installed, or in the source tree; empty if they are not found.
std::string SamplesFolder();

}  // namespace islet
