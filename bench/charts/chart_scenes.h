// The scenes of the charts: plans that every engine can build, and the number that says how wrong a run of it was.
//
//   threads: pure functions
#pragma once

#include <span>
#include <string_view>

#include "bench/charts/judge.h"
#include "bench/peers/peer.h"

namespace islet::charts {

struct Outcome {
  double error;             // what the chart draws
  std::string_view failed;  // not empty: what went wrong in kind, so that the point belongs to the border
};

struct ChartScene {
  std::string_view name;
  double seconds;  // [s] simulated
  bool quick;      // in chart-quick too
  double limit;    // [s] of stepping, after which a run is cut
  std::string_view summary;
  std::string_view error_name;  // with unit
  std::string_view why;         // why that is the error: what the exact answer is, and by which argument
  peers::WorldPlan (*plan)();
  Outcome (*judge)(const peers::WorldPlan& plan, std::span<const peers::State> end, const Measures& measures);
};

std::span<const ChartScene> AllChartScenes();
const ChartScene* FindChartScene(std::string_view name);  // null if there is none

}  // namespace islet::charts
