#include "scenes/run_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace islet {
namespace {

// As a shell reads it back.
std::string Quoted(const std::string& word) {
  const auto plain = [](unsigned char c) {
    return std::isalnum(c) || std::string("_-./,:=+@%").find(static_cast<char>(c)) != std::string::npos;
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), plain)) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::string CommandOf(const RunOptions& o) {
  std::string command = "islet run " + Quoted(o.scene);
  const auto add = [&](const char* name, const auto& value) {
    if (value) command += fmt::format(" {} {}", name, *value);
  };
  const auto add_name = [&](const char* name, const std::optional<std::string>& value) {
    if (value) command += fmt::format(" {} {}", name, Quoted(*value));
  };
  const SceneParameters& p = o.parameters;
  add("--count", p.count);
  add("--seed", p.seed);
  add("--friction", p.friction);
  add("--restitution", p.restitution);
  add("--drop", p.drop);
  add("--angle", p.angle);
  add("--incoming", p.incoming);
  add("--frames", o.frames);
  add("--seconds", o.seconds);
  if (o.dt != RunOptions().dt) command += fmt::format(" --dt {}", o.dt);
  if (o.paper) command += " --paper";
  add_name("--model", o.model);
  add_name("--cone", o.cone);
  add_name("--ladder", o.ladder);
  add_name("--effort", o.effort);
  add("--tolerance", o.tolerance);
  add_name("--bounce", o.bounce);
  add_name("--bounce-limit", o.bounce_limit);
  add_name("--freeze", o.freeze);
  add("--freeze-count", o.freeze_count);
  add("--group-bodies", o.group_bodies);
  return command;
}

}  // namespace islet
