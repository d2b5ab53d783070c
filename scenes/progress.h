// Tells on the standard error output how far a run is: one line that fits the terminal, or elsewhere a plain line per
// simulated second.
//
//   on a terminal   12.30 of 40 s  frame 369  53.1 ms a frame  about 3 min left, or until rest  and, where they fit, numbers and a bar
//   What is left is the time until the latest possible end at the pace of the last hundred frames; nothing is said in the first second.
#pragma once

#include <deque>

#include "engine/step_report.h"
#include "scenes/terminal_line.h"

namespace islet {

class Progress {
 public:
  // frame_limit: latest possible end; until_rest: the run may come to rest before.
  Progress(int frame_limit, double dt, bool until_rest);
  void Update(int frame, double step_seconds, const StepReport& report);
  void Finish(int frame, double step_seconds, const StepReport& report);  // the last state, whole line
  void End() { line_.End(); }                                             // without a last state

 private:
  std::string Line(int frame, double step_seconds, const StepReport& report) const;
  std::string Left(int frame) const;

  int frame_limit_;
  double dt_;  // [s]
  bool until_rest_;
  TerminalLine line_;
  double next_print_ = 0;     // [s] simulated time, or on a terminal wall time
  double start_;              // [s] wall time
  std::deque<double> ended_;  // [s] wall time when the last frames had ended
};

}  // namespace islet
