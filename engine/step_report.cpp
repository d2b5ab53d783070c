#include "engine/step_report.h"

#include <algorithm>

namespace islet {

void Certificate::Include(const Certificate& other) {
  momentum = std::max(momentum, other.momentum);
  cone = std::max(cone, other.cone);
  dual = std::max(dual, other.dual);
  gap = std::max(gap, other.gap);
  natural_map_max = std::max(natural_map_max, other.natural_map_max);
  natural_map_rms = std::max(natural_map_rms, other.natural_map_rms);
  coulomb_map_max = std::max(coulomb_map_max, other.coulomb_map_max);
  coulomb_map_rms = std::max(coulomb_map_rms, other.coulomb_map_rms);
  energy_gain = std::max(energy_gain, other.energy_gain);
}

const char* ToString(QpStatus status) {
  switch (status) {
    case QpStatus::kNone:
      return "none";
    case QpStatus::kSolved:
      return "solved";
    case QpStatus::kInaccurate:
      return "inaccurate";
    case QpStatus::kInfeasible:
      return "infeasible";
    case QpStatus::kFailed:
      return "failed";
  }
  return "unknown";
}

}  // namespace islet
