// The command `islet replay`: tells what a recording holds, runs it again to compare, or makes a glTF file of it.
#pragma once

#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace islet {

struct ReplayOptions {
  std::string file;
  bool check = false;          // run again, compare every frame
  std::string out;             // .glb, or empty
  std::optional<int> threads;  // of the run again; 0: all cores
};

void AddReplayOptions(CLI::App* command, ReplayOptions* options);

//   errors: std::invalid_argument for a file that is no recording or is damaged, and for options that are wrong; std::runtime_error for a
//           run that differs, which names the first frame that does, and for an output that cannot be written
void Replay(const ReplayOptions& options);

}  // namespace islet
