// Wall time for reports. No result may depend on it.
//   threads: Seconds from anywhere; a timer belongs to one thread
#pragma once

#include <chrono>

namespace islet {

inline double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Adds the time since the last lap to a stage.
class LapTimer {
 public:
  void Lap(double* stage) {
    const double now = Seconds();
    *stage += now - last_;
    last_ = now;
  }

 private:
  double last_ = Seconds();
};

// Time since it was made.
class Stopwatch {
 public:
  double seconds() const { return Seconds() - start_; }
  double begin() const { return start_; }  // of Seconds()

 private:
  double start_ = Seconds();
};

}  // namespace islet
