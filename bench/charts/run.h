// One run: a plan, an engine, a setting, from the start to the end or to a limit on time; and how long its steps took.
//
//   clock: wall time of each Step(); processor time of the whole process between two samples, without judging
//   short runs are repeated and the fastest counts; all repeats must end in the same state
#pragma once

#include <cstdint>

#include "bench/charts/chart_scenes.h"
#include "bench/charts/judge.h"
#include "bench/peers/peer.h"

namespace islet::charts {

struct Limits {
  double stepping = 10;       // [s] wall or processor time, whichever is less; a run that takes longer is cut: failed
  double repeat_until = 0.3;  // [s] of stepping in all repeats
  int repeats = 5;
  int start = 0;  // which of the scene's starts
};

struct RunResult {  // plain data: it crosses a pipe
  Measures measures;
  double error = 0;
  char failed[64] = "";       // what went wrong; empty: nothing
  double simulated = 0;       // [s]
  double wall = 0, cpu = 0;   // [s] of all steps
  double step_median = 0;     // [s]
  double step_p99 = 0;        // [s]
  double contacts_mean = -1;  // as the engine tells, at the samples; -1: it does not
  std::uint64_t hash = 0;
  int repeats = 0;
  bool repeatable = true;
  long memory_kib = 0;  // largest resident set of the run's process
};

// In this process.
RunResult Run(const ChartScene& scene, const peers::Engine& engine, const peers::Setting& setting,
              const Limits& limits);

// In a process of its own, so that a crash ends one run and memory is that run's. A refusal, a crash and a cut run say so
// in `failed`.
RunResult RunApart(const ChartScene& scene, const peers::Engine& engine, const peers::Setting& setting,
                   const Limits& limits);

}  // namespace islet::charts
