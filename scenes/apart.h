// Runs work in a process of its own, so that it can be given up: what hangs, crashes or eats all memory there costs its own result alone.
//
//   in: work that returns a text     out: that text, or how it ended without one
//   rule: a clock decides only that the work is given up, never what it returns
//   errors: std::runtime_error if no process could be started
//   threads: the caller must have no other threads when it calls; the work may start as many as it likes
#pragma once

#include <functional>
#include <optional>
#include <string>

namespace islet {

struct ApartEnd {
  enum class How { kDone, kTimeLimit, kInterrupt, kCrash };
  How how = How::kCrash;
  std::string text;  // kDone: what the work returned; kCrash: why
  std::string told;  // the last that it told before
};

// Tells the caller something while the work goes on.
using Tell = std::function<void(const std::string&)>;

// limit: [s] of wall time; none: as long as it takes. watch(seconds, told) is called when something is told, and ten times a second.
// An interrupt (interrupt.h) ends the work at once.
ApartEnd RunApart(const std::function<std::string(const Tell& tell)>& work, std::optional<double> limit,
                  const std::function<void(double seconds, const std::string& told)>& watch);

}  // namespace islet
