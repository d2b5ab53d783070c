#include "scenes/recorder.h"

#include <fmt/format.h>

#include <string>

namespace islet {
namespace {

// As a shell reads it back.
std::string Quoted(const std::string& text) {
  constexpr const char* kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/@%";
  if (!text.empty() && text.find_first_not_of(kPlain) == std::string::npos) return text;
  std::string quoted(1, '\'');
  for (const char c : text) {
    if (c == '\'') quoted += "'\\'";
    quoted += c;
  }
  quoted += '\'';
  return quoted;
}

}  // namespace

FilmHead RunHead(const RunOptions& options, const Scene& scene, const SceneInfo& info, const World& world) {
  std::string command = "islet run";
  for (const std::string& argument : options.arguments) command.append(" ").append(Quoted(argument));
  FilmHead head = HeadOf(world, options.dt, std::string(scene.name), command, info.bounds);
  head.arguments = options.arguments;
  head.version = ISLET_VERSION;
  return head;
}

Recorder::Recorder(const RunOptions& options, const Scene& scene, const SceneInfo& info, const World& world)
    : start_(PotentialEnergy(world)), writer_(options.record, RunHead(options, scene, info, world)) {
  writer_.Add(FrameOf(world, {}, 0, 0, start_));
}

void Recorder::Add(const World& world, const StepReport& report, int frame, double step_seconds) {
  writer_.Add(FrameOf(world, report, frame, step_seconds, start_));
}

void Recorder::Finish(const std::string& stopped_by) { writer_.Finish(stopped_by); }

}  // namespace islet
