#include "engine/step_report.h"

#include <algorithm>
#include <utility>

namespace islet {

void Certificate::Include(const Certificate& other) {
  momentum = Worse(momentum, other.momentum);
  cone = Worse(cone, other.cone);
  dual = Worse(dual, other.dual);
  gap = Worse(gap, other.gap);
  natural_map_max = Worse(natural_map_max, other.natural_map_max);
  natural_map_rms = Worse(natural_map_rms, other.natural_map_rms);
  coulomb_map_max = Worse(coulomb_map_max, other.coulomb_map_max);
  coulomb_map_rms = Worse(coulomb_map_rms, other.coulomb_map_rms);
  energy_gain = Worse(energy_gain, other.energy_gain);
}

void LadderReport::Add(qp::Rung rung, std::int64_t problems, std::int64_t contacts, double seconds) {
  Rung& entry = rungs[static_cast<size_t>(rung)];
  entry.problems += problems;
  entry.contacts += contacts;
  entry.seconds += seconds;
}

void LadderReport::Include(const LadderReport& other) {
  for (size_t r = 0; r < rungs.size(); ++r) {
    rungs[r].problems += other.rungs[r].problems;
    rungs[r].contacts += other.rungs[r].contacts;
    rungs[r].seconds += other.rungs[r].seconds;
  }
}

void Ledger::Include(const Ledger& other) {
  energy_created.Include(other.energy_created.value, other.energy_created.body);
  momentum_unexplained.Include(other.momentum_unexplained.value, other.momentum_unexplained.body);
  angular_momentum_unexplained.Include(other.angular_momentum_unexplained.value,
                                       other.angular_momentum_unexplained.body);
  displacement_without_velocity.Include(other.displacement_without_velocity.value,
                                        other.displacement_without_velocity.body);
  sides_changed += other.sides_changed;
  if (other.side_changer >= 0) side_changer = other.side_changer;
}

bool Ledger::Clean() const {
  return energy_created.value <= kMostEnergy && momentum_unexplained.value <= kMostMomentum &&
         angular_momentum_unexplained.value <= kMostMomentum && sides_changed == 0;
}

void StepReport::Add(const IslandReport& island) {
  islands.push_back(island);
  active_contacts += island.contacts;
  largest_island_contacts = std::max(largest_island_contacts, island.contacts);
}

void QpSummary::Include(const QpSummary& other) {
  solved += other.solved;
  failed += other.failed;
  missed += other.missed;
  worst_map = Worse(worst_map, other.worst_map);
  iterations += other.iterations;
  iterations_max = std::max(iterations_max, other.iterations_max);
  seconds += other.seconds;
}

void StageSeconds::Include(const StageSeconds& other) {
  detect += other.detect;
  islands += other.islands;
  pq += other.pq;
  collision_qp += other.collision_qp;
  static_qp += other.static_qp;
  freeze += other.freeze;
  move += other.move;
}

void StepReport::Append(StepReport later) {
  islands = std::move(later.islands);
  contacts = later.contacts;
  active_contacts = later.active_contacts;
  awake = later.awake;
  frozen = later.frozen;
  overlapping = later.overlapping;
  kinetic_energy = later.kinetic_energy;
  largest_island_contacts = std::max(largest_island_contacts, later.largest_island_contacts);
  bounces += later.bounces;
  restitution_lowered += later.restitution_lowered;
  frozen_imbalance = std::max(frozen_imbalance, later.frozen_imbalance);
  collision_qp.Include(later.collision_qp);
  static_qp.Include(later.static_qp);
  ladder.Include(later.ladder);
  motion_ladder.Include(later.motion_ladder);
  seconds.Include(later.seconds);
  certificate.Include(later.certificate);
  penetration_max = std::max(penetration_max, later.penetration_max);
  motion_passes = std::max(motion_passes, later.motion_passes);
  motion_failures = std::max(motion_failures, later.motion_failures);
  gave_up = std::max(gave_up, later.gave_up);
  ledger.Include(later.ledger);
  energy_gain += later.energy_gain;
  pieces += later.pieces;
  unstepped += later.unstepped;
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
