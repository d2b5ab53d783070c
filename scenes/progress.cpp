#include "scenes/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>

namespace islet {
namespace {

constexpr double kRefresh = 0.1;  // [s] wall time between two drawings of the bar
constexpr int kBarWidth = 30;

double WallTime() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

}  // namespace

Progress::Progress(double end_time) : end_time_(end_time), terminal_(::isatty(STDERR_FILENO) != 0) {
  if (!terminal_) next_print_ = 1;
}

void Progress::Update(double time, int frame, double step_seconds, const StepReport& report) {
  const double now = terminal_ ? WallTime() : time + 1e-9;  // frames that sum up to a second count as one
  if (now < next_print_) return;
  next_print_ = terminal_ ? now + kRefresh : std::floor(now) + 1;
  Print(time, frame, step_seconds, report);
}

void Progress::Finish(double time, int frame, double step_seconds, const StepReport& report) {
  if (!terminal_) return;
  Print(time, frame, step_seconds, report);
  std::fputc('\n', stderr);
}

void Progress::Print(double time, int frame, double step_seconds, const StepReport& report) const {
  const std::string numbers =
      fmt::format("{:6.2f} s  frame {:5}  {:6.1f} ms  contacts {:5}  awake {:5}  kinetic {:9.3e} J", time, frame,
                  1e3 * step_seconds, report.active_contacts, report.awake, report.kinetic_energy);
  if (terminal_) {
    const int filled = static_cast<int>(std::clamp(time / end_time_, 0.0, 1.0) * kBarWidth);
    fmt::print(stderr, "\r[{:=<{}}{: <{}}] {}\033[K", "", filled, "", kBarWidth - filled, numbers);
  } else {
    fmt::print(stderr, "{}\n", numbers);
  }
  std::fflush(stderr);
}

}  // namespace islet
