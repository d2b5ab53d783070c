// One row of numbers per frame, as comma-separated values with a header line.
//
// Columns: frame (from 1), contacts, active_contacts, islands, largest_island_contacts, collision_qp_seconds [s],
// static_qp_seconds [s], iterations (interior point, both problems), awake, kinetic_energy [J], penetration_max [m],
// woken, frozen, step_seconds [s]; by rung of the ladder: problems that it answered, and what detection was spared;
// natural_map_max, coulomb_map_max [m/s] at the worst contact: of the model that was solved, and of exact Coulomb friction;
// problems_missed, problems_failed: that ended above the tolerance, and that have no answer; of the ledger (engine/step_report.h):
// energy_created, momentum_unexplained, angular_momentum_unexplained, displacement_without_velocity [m], sides_changed;
// overlapping: pairs of bodies; step_failed: 1 if the step did what physics does not allow, or did not do all of it.
#pragma once

#include <string>

#include "engine/step_report.h"

namespace islet {

class FrameLog {
 public:
  FrameLog();
  void Add(const StepReport& report, double step_seconds);
  const std::string& text() const { return text_; }

 private:
  int frames_ = 0;
  std::string text_;  // whole table; written when the run is over, so that no half table is left by a broken one
};

}  // namespace islet
