#include "scenes/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "engine/stopwatch.h"
#include "scenes/output_file.h"

namespace islet {
namespace {

constexpr double kRefresh = 0.1;            // [s] wall time between two drawings of the line
constexpr double kFirstEstimate = 1;        // [s] wall time: a pace from less is a guess
constexpr size_t kPaceFrames = 100;         // whose pace tells what is left
constexpr size_t kBar = 12, kMostBar = 40;  // characters between its brackets

// As exact as such an estimate may sound.
std::string Rough(double seconds) {
  if (seconds < 10) return fmt::format("{:.0f} s", std::ceil(seconds));
  if (seconds < 100) return fmt::format("{:.0f} s", 5 * std::ceil(seconds / 5));
  if (seconds < 100 * 60) return fmt::format("{:.0f} min", std::ceil(seconds / 60));
  if (seconds < 48 * 3600) return fmt::format("{:.0f} h", std::ceil(seconds / 3600));
  return fmt::format("{:.0f} days", std::ceil(seconds / 86400));
}

}  // namespace

Progress::Progress(int frame_limit, double dt, bool until_rest)
    : frame_limit_(frame_limit), dt_(dt), until_rest_(until_rest), start_(Seconds()) {
  if (!line_.on_terminal()) next_print_ = 1;
  ended_.push_back(start_);
}

void Progress::Update(int frame, double step_seconds, const StepReport& report) {
  const double wall = Seconds(), time = frame * dt_;
  ended_.push_back(wall);
  if (ended_.size() > kPaceFrames + 1) ended_.pop_front();
  const double now = line_.on_terminal() ? wall : time + 1e-9;  // frames that sum up to a second count as one
  if (now < next_print_) return;
  next_print_ = line_.on_terminal() ? now + kRefresh : std::floor(now) + 1;
  if (line_.on_terminal()) {
    line_.Show(Line(frame, step_seconds, report));
    return;
  }
  Print(stderr, fmt::format("{:6.2f} s  frame {:5}  {:6.1f} ms  contacts {:5}  awake {:5}  kinetic {:9.3e} J\n", time,
                            frame, 1e3 * step_seconds, report.active_contacts, report.awake, report.kinetic_energy));
}

void Progress::Finish(int frame, double step_seconds, const StepReport& report) {
  line_.Show(Line(frame, step_seconds, report));
  line_.End();
}

std::string Progress::Left(int frame) const {
  const double last = ended_.back();
  if (frame >= frame_limit_ || last - start_ < kFirstEstimate) return "";
  const double pace = (last - ended_.front()) / static_cast<double>(ended_.size() - 1);
  return fmt::format("about {} left{}", Rough(pace * (frame_limit_ - frame)), until_rest_ ? ", or until rest" : "");
}

// The most telling first, and what does not fit is left out.
std::string Progress::Line(int frame, double step_seconds, const StepReport& report) const {
  const double end = frame_limit_ * dt_;
  const std::string parts[] = {
      fmt::format("{:.2f} of {:.4g} s", frame * dt_, end),   fmt::format("frame {}", frame),
      fmt::format("{:.1f} ms a frame", 1e3 * step_seconds),  Left(frame),
      fmt::format("contacts {}", report.active_contacts),    fmt::format("awake {}", report.awake),
      fmt::format("kinetic {:.2e} J", report.kinetic_energy)};
  const size_t width = line_.width();
  std::string line;
  for (const std::string& part : parts) {
    if (part.empty()) continue;
    const std::string longer = line.empty() ? part : line + "  " + part;
    if (longer.size() > width) break;
    line = longer;
  }
  if (line.size() + kBar + 3 > width) return line;
  const size_t bar = std::min(width - line.size() - 3, kMostBar);
  const auto filled = static_cast<size_t>(std::clamp(frame * dt_ / end, 0.0, 1.0) * static_cast<double>(bar));
  return fmt::format("[{}{}] {}", std::string(filled, '='), std::string(bar - filled, ' '), line);
}

}  // namespace islet
