// Seconds since it was made: of the wall clock, and of the processor in the thread that asks (which must be the one that
// made it).
#pragma once

#include <chrono>
#include <ctime>

namespace islet::qp {

class Stopwatch {
 public:
  double Wall() const { return std::chrono::duration<double>(Clock::now() - wall_).count(); }
  double Cpu() const { return ThreadSeconds() - cpu_; }

 private:
  using Clock = std::chrono::steady_clock;
  static double ThreadSeconds() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
  Clock::time_point wall_ = Clock::now();
  double cpu_ = ThreadSeconds();
};

}  // namespace islet::qp
