// The command `islet solve`: reads problems that others wrote, solves them, and tells how exact the answers are.
//
//   table on the standard output, a JSON list with --report; on a file that cannot be read or solved a message on the standard
//   error, an entry in both, and the other files are still solved
//   each file is read and solved in a process of its own: one that hangs or crashes costs no other. On the standard error it says
//   which file it is at. An interrupt ends it at once; what was solved before is reported
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
  std::optional<int> threads;        // 0: all cores
  std::optional<double> time_limit;  // [s] wall time a problem, its reading included; none: as long as it takes
  bool strict = false;               // a problem that is not solved is an exit status of its own
  std::string report;                // file, "-" for the standard output, empty for none
};

void AddSolveOptions(CLI::App* command, SolveOptions* options);

enum class SolveEnd { kSolved, kNotSolved, kNotRead };

// kNotRead if a file could not be read, else kNotSolved if one could not be solved: to the tolerance, in time or at all.
SolveEnd SolveFiles(const SolveOptions& options);

}  // namespace islet
