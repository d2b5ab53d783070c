// The command `islet verify`: runs scenes whose answer is known, and tells how far off the engine is.
//
//   table on the standard output, a JSON list with --report ("-": that one there and the table on the standard error)
//   an interrupt ends it after the run under way; what was measured is reported
//   errors: std::invalid_argument that names the option and its value, before any check runs
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scenes/verify/check.h"

namespace CLI {
class App;
}

namespace islet {

struct VerifyOptions {
  std::vector<std::string> ids;  // none: all
  std::string dt = "1/60,1/240", model = "coulomb", freeze = "off,certified";
  std::string effort = "normal";
  std::string gate;  // "G1,G2"; empty: all
  double tolerance = 1e-6;
  std::optional<int> threads;  // 0: all cores
  int group_bodies = 20;
  bool quick = false, all_settings = false, list = false;
  std::string report;  // file, "-" for the standard output, empty for none
};

void AddVerifyOptions(CLI::App* command, VerifyOptions* options);

// True if no gate failed, or nothing was to be run.
bool Verify(const VerifyOptions& options, std::span<const Check> checks);

}  // namespace islet
