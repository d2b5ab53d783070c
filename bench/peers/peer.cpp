#include "bench/peers/peer.h"

#include <algorithm>

#include "bench/peers/sweeps.h"

namespace islet::peers {

Vector3 BodyPlan::Inertia() const {
  if (form == Form::kSphere) return Vector3::Constant(0.4 * mass * radius * radius);
  if (form == Form::kHull) return mass * moments_per_mass;
  const Vector3 squares = half_extents.cwiseAbs2();
  return mass / 3 * (Vector3::Constant(squares.sum()) - squares);
}

void AddTimeSteps(Setting start, std::span<const int> per_second, std::span<const int> quick_per_second,
                  std::vector<Setting>* settings) {
  for (const int rate : per_second) {
    Setting setting = start;
    setting.sweep = "dt";
    setting.dt = 1.0 / rate;
    setting.is_default = start.is_default && setting.dt == start.dt;
    setting.quick = std::ranges::find(quick_per_second, rate) != quick_per_second.end();
    settings->push_back(setting);
  }
}

void AddIterations(Setting start, std::span<const int> iterations, std::span<const int> quick_iterations,
                   std::vector<Setting>* settings) {
  for (const int count : iterations) {
    Setting setting = start;
    setting.sweep = "iterations";
    setting.iterations = count;
    setting.is_default = false;
    setting.quick = std::ranges::find(quick_iterations, count) != quick_iterations.end();
    settings->push_back(setting);
  }
}

}  // namespace islet::peers
