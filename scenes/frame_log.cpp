#include "scenes/frame_log.h"

#include <fmt/format.h>

#include <iterator>

namespace islet {

FrameLog::FrameLog()
    : text_(
          "frame,contacts,active_contacts,islands,largest_island_contacts,collision_qp_seconds,static_qp_seconds,"
          "iterations,awake,kinetic_energy,penetration_max,woken,frozen,step_seconds") {
  for (const char* rung : qp::kRungNames) fmt::format_to(std::back_inserter(text_), ",{}", rung);
  text_ +=
      ",natural_map_max,coulomb_map_max,problems_missed,problems_failed,energy_created,momentum_unexplained,"
      "angular_momentum_unexplained,displacement_without_velocity,sides_changed,overlapping,step_failed\n";
}

void FrameLog::Add(const StepReport& r, double step_seconds) {
  fmt::format_to(std::back_inserter(text_), "{},{},{},{},{},{:.6g},{:.6g},{},{},{:.9g},{:.6g},{},{},{:.6g}", ++frames_,
                 r.contacts, r.active_contacts, r.islands.size(), r.largest_island_contacts, r.collision_qp.seconds,
                 r.static_qp.seconds, r.collision_qp.iterations + r.static_qp.iterations, r.awake, r.kinetic_energy,
                 r.penetration_max, r.woken, r.frozen, step_seconds);
  for (int rung = 0; rung < qp::kNumRungs; ++rung) {
    const LadderReport& ladder = rung < qp::kNumProblemRungs ? r.ladder : r.motion_ladder;
    fmt::format_to(std::back_inserter(text_), ",{}", ladder.rungs[rung].problems);
  }
  const Ledger& l = r.ledger;
  fmt::format_to(std::back_inserter(text_), ",{:.6g},{:.6g},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{},{},{}\n",
                 r.certificate.natural_map_max, r.certificate.coulomb_map_max,
                 r.collision_qp.missed + r.static_qp.missed, r.collision_qp.failed + r.static_qp.failed,
                 l.energy_created.value, l.momentum_unexplained.value, l.angular_momentum_unexplained.value,
                 l.displacement_without_velocity.value, l.sides_changed, r.overlapping, r.Failed() ? 1 : 0);
}

}  // namespace islet
