// The command `islet solve`: reads problems that others wrote, solves them, and tells how exact the answers are.
//
//   table on the standard output, a JSON list with --report; on a file that cannot be read or solved a message on the standard
//   error, an entry in both, and the other files are still solved
//   an interrupt ends it after the file under way; what was solved is reported
//   errors: std::invalid_argument that names the option and its value, before any file is read
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace islet {

struct SolveOptions {
  std::vector<std::string> files;
  std::string model = "coulomb", cone = "circular";
  double tolerance = 1e-6;
  std::optional<int> threads;  // 0: all cores
  std::string report;          // file, "-" for the standard output, empty for none
};

void AddSolveOptions(CLI::App* command, SolveOptions* options);

// True if every file could be read; what the solvers could not do is in the table.
bool SolveFiles(const SolveOptions& options);

}  // namespace islet
