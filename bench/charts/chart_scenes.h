// The scenes of the charts: plans that every engine can build, and the number that says how wrong a run of it was.
//
// Where a run is one of many that could have been (chaos), the scene has several starts: in number 0 it is as it is, in the
// others every moving body is shifted by up to kShift along each axis.
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
  int starts;      // 1: one is enough
  bool few;        // in chart, too, only with the settings of chart-quick: long runs
  std::string_view summary;
  std::string_view error_name;  // with unit
  std::string_view why;         // why that is the error: what the exact answer is, and by which argument
  peers::WorldPlan (*plan)();
  Outcome (*judge)(const peers::WorldPlan& plan, std::span<const peers::State> end, const Measures& measures);
};

inline constexpr double kShift = 1e-3;  // [m]

peers::WorldPlan PlanOf(const ChartScene& scene, int start);

std::span<const ChartScene> AllChartScenes();
const ChartScene* FindChartScene(std::string_view name);  // null if there is none

}  // namespace islet::charts
