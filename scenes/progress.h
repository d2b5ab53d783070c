// Tells on the standard error output how far a run is: a bar on a terminal, a plain line per simulated second
// elsewhere.
#pragma once

#include "engine/step_report.h"

namespace islet {

class Progress {
 public:
  explicit Progress(double end_time);  // [s] latest possible end of the run
  void Update(double time, int frame, double step_seconds, const StepReport& report);
  void Finish(double time, int frame, double step_seconds, const StepReport& report);  // the last state, whole line

 private:
  void Print(double time, int frame, double step_seconds, const StepReport& report) const;

  double end_time_;
  bool terminal_;
  double next_print_ = 0;  // [s] simulated time, or on a terminal wall time
};

}  // namespace islet
