#include "scenes/recorder.h"

#include <fmt/format.h>

#include <cstdio>
#include <stdexcept>

#include "scenes/about.h"
#include "scenes/film/film_head.h"
#include "scenes/output_file.h"

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

FilmHead RunHead(const RunOptions& options, const ReadyScene& scene) {
  std::string command = "islet run";
  for (const std::string& argument : options.arguments) command.append(" ").append(Quoted(argument));
  FilmHead head = HeadOf(scene.world, scene.dt, scene.name, command, scene.info.bounds);
  head.title = scene.title;
  head.about = scene.about;
  head.arguments = options.arguments;
  head.version = Version();
  if (scene.text.size() <= kMostHeadBytes / 2) head.scene_text = scene.text;
  return head;
}

Recorder::Recorder(const RunOptions& options, const ReadyScene& scene)
    : path_(options.record), start_(PotentialEnergy(scene.world)), writer_(options.record, RunHead(options, scene)) {
  writer_.Add(FrameOf(scene.world, {}, 0, 0, start_));
}

void Recorder::Add(const World& world, const StepReport& report, int frame, double step_seconds) {
  if (!failure_.empty()) return;
  try {
    writer_.Add(FrameOf(world, report, frame, step_seconds, start_));
  } catch (const std::runtime_error& error) {
    failure_ = fmt::format("{}; the recording ends before frame {}", error.what(), frame);
    Print(stderr, fmt::format("islet: {}, the run goes on\n", failure_));
  }
}

void Recorder::Finish(const std::string& stopped_by) {
  if (!failure_.empty()) throw std::runtime_error(failure_);
  writer_.Finish(stopped_by);
}

}  // namespace islet
