#include "scenes/run_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "scenes/effort_option.h"
#include "scenes/printable.h"
#include "scenes/run_options.h"

namespace islet {
namespace {

using Json = nlohmann::ordered_json;

Vector3 Momentum(const World& world) {
  Vector3 sum = Vector3::Zero();
  for (const Body& body : world.bodies()) {
    if (body.kind == BodyKind::kDynamic) sum += body.mass * body.linear_velocity_W;
  }
  return sum;
}

double KineticEnergy(const World& world) {
  double sum = 0;
  for (const Body& body : world.bodies()) {
    if (body.kind == BodyKind::kDynamic) sum += body.KineticEnergy();
  }
  return sum;
}

// [kg m] sum of mass times place: gravity g makes it - g times that of potential energy.
Vector3 MassMoment(const World& world) {
  Vector3 sum = Vector3::Zero();
  for (const Body& body : world.bodies()) {
    if (body.kind == BodyKind::kDynamic) sum += body.mass * body.position_W;
  }
  return sum;
}

bool Inside(const Region& region, const Vector3& point) {
  return (point.array() >= region.lower.array()).all() && (point.array() <= region.upper.array()).all();
}

// Nearest rank: the smallest value that is not below a share q of the values.
double Quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const double rank = std::ceil(q * static_cast<double>(values.size()));
  const auto nth = values.begin() + std::max(0, static_cast<int>(rank) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

Json QpJson(const QpSummary& qp, double frames) {
  const double problems = std::max(1, qp.solved);
  return {{"solved", qp.solved},
          {"seconds_mean", qp.seconds / problems},
          {"iterations_mean", qp.iterations / problems},
          {"iterations_max", qp.iterations_max},
          {"failed", qp.failed},
          {"missed", qp.missed},
          {"missed_share", qp.missed / problems},
          {"worst_map", qp.worst_map},
          {"seconds_per_frame", qp.seconds / frames}};
}

// Its rungs from `first` on, up to `last`.
Json LadderJson(const LadderReport& ladder, int first, int last) {
  Json json;
  for (int r = first; r < last; ++r) {
    const LadderReport::Rung& rung = ladder.rungs[r];
    json[qp::kRungNames[r]] = {{"problems", rung.problems}, {"contacts", rung.contacts}, {"seconds", rung.seconds}};
  }
  return json;
}

Json CertificateJson(const Certificate& c) {
  return {{"momentum", c.momentum},
          {"cone", c.cone},
          {"dual", c.dual},
          {"gap", c.gap},
          {"natural_map_max", c.natural_map_max},
          {"natural_map_rms", c.natural_map_rms},
          {"coulomb_map_max", c.coulomb_map_max},
          {"coulomb_map_rms", c.coulomb_map_rms}};
}

// Of what a failed step did wrong, the plainest.
std::string WhyFailed(const StepReport& report) {
  const Ledger& l = report.ledger;
  if (l.sides_changed > 0) return fmt::format("body {} went through another", l.side_changer);
  if (report.overlapping > 0) return fmt::format("pairs of bodies inside of each other: {}", report.overlapping);
  if (report.unstepped > 0) return fmt::format("a group found no way on for {:.2g} s", report.unstepped);
  if (!(l.energy_created.value <= Ledger::kMostEnergy))
    return fmt::format("{:.1e} of the energy at hand was created", l.energy_created.value);
  const LedgerEntry& turned = l.angular_momentum_unexplained;
  const bool turns = !(turned.value <= Ledger::kMostMomentum);
  const LedgerEntry& worst = turns ? turned : l.momentum_unexplained;
  return fmt::format("{} of body {} unexplained: {:.1e}", turns ? "angular momentum" : "momentum", worst.body,
                     worst.value);
}

// In the order of the report.
constexpr std::array kLedgerEntries{&Ledger::energy_created, &Ledger::momentum_unexplained,
                                    &Ledger::angular_momentum_unexplained, &Ledger::displacement_without_velocity};

}  // namespace

std::string CountedBodies(int count) { return fmt::format("{} {}", count, count == 1 ? "body" : "bodies"); }

void RunReport::Series::Add(double value) {
  sum += value;
  max = std::max(max, value);
}

RunReport::RunReport(std::string name, std::string expected, const SceneInfo& info, const World& world, double dt)
    : name_(std::move(name)), expected_(std::move(expected)), info_(info), settings_(world.settings()), dt_(dt) {
  for (const Body& body : world.bodies()) {
    if (body.kind != BodyKind::kDynamic) ++fixed_bodies_;
    if (body.kind == BodyKind::kDynamic) momentum_scale_ += body.mass * body.linear_velocity_W.norm();
  }
  momentum_start_ = Momentum(world);
  kinetic_energy_before_ = KineticEnergy(world);
  mass_moment_ = MassMoment(world);
}

void RunReport::AddFrame(const StepReport& report, double step_seconds, const World& world) {
  step_seconds_.push_back(step_seconds);
  stages_.Include(report.seconds);
  contacts_.Add(report.contacts);
  active_contacts_.Add(report.active_contacts);
  islands_.Add(static_cast<double>(report.islands.size()));
  largest_island_.Add(report.largest_island_contacts);
  penetration_.Add(Worse(0.0, report.penetration_max));
  collision_qp_.Include(report.collision_qp);
  static_qp_.Include(report.static_qp);
  ladder_.Include(report.ladder);
  motion_ladder_.Include(report.motion_ladder);
  certificate_.Include(report.certificate);
  for (size_t k = 0; k < kLedgerEntries.size(); ++k) {
    const LedgerEntry& entry = report.ledger.*kLedgerEntries[k];
    if ((ledger_.*kLedgerEntries[k]).Include(entry.value, entry.body))
      ledger_frames_[k] = static_cast<int>(step_seconds_.size());
  }
  ledger_.Include(report.ledger);
  if (report.Failed() && failed_steps_++ == 0) {
    first_failed_ = static_cast<int>(step_seconds_.size());
    why_failed_ = WhyFailed(report);
  }
  energy_gain_max_ = std::max(energy_gain_max_, report.energy_gain);
  bounces_ += report.bounces;
  woken_ += report.woken;
  woken_max_ = std::max(woken_max_, report.woken);
  motion_passes_max_ = std::max(motion_passes_max_, report.motion_passes);
  motion_failures_ += report.motion_failures;
  gave_up_ += report.gave_up > 0;
  gave_up_max_ = std::max(gave_up_max_, report.gave_up);
  frozen_imbalance_ = std::max(frozen_imbalance_, report.frozen_imbalance);
  restitution_lowered_ += report.restitution_lowered;

  const Vector3 gravity_W = world.settings().gravity, moment = MassMoment(world);  // a drive may have changed it
  const double kinetic = KineticEnergy(world),
               gain = kinetic - kinetic_energy_before_ - gravity_W.dot(moment - mass_moment_);
  mechanical_energy_gain_ += std::max(0.0, gain);
  kinetic_energy_before_ = kinetic;
  mass_moment_ = moment;
  weightless_ = weightless_ && gravity_W.isZero(0);
  frozen_ = report.frozen;
  awake_ = report.awake;
  kinetic_energy_ = report.kinetic_energy;
}

void RunReport::Finish(const World& world, double wall_seconds, const char* stopped_by) {
  sim_seconds_ = static_cast<double>(step_seconds_.size()) * dt_;
  wall_seconds_ = wall_seconds;
  stopped_by_ = stopped_by;
  momentum_drift_ = (Momentum(world) - momentum_start_).norm() / std::max(momentum_scale_, 1e-300);
  for (const Body& body : world.bodies()) {
    if (body.kind != BodyKind::kDynamic) continue;
    if (info_.bounds && !Inside(*info_.bounds, body.position_W)) ++escaped_;
    if (info_.passed_z && body.position_W.z() < *info_.passed_z) ++passed_;
  }
  state_hash_ = fmt::format("{:016x}", world.StateHash());
}

std::string RunReport::Json() const {
  const double frames = std::max<double>(1, static_cast<double>(step_seconds_.size()));
  const auto mean_max = [&](const Series& s) { return islet::Json{{"mean", s.sum / frames}, {"max", s.max}}; };
  const bool isolated = weightless_ && fixed_bodies_ == 0 && momentum_scale_ > 0;
  double sum = 0;
  for (const double seconds : step_seconds_) sum += seconds;

  islet::Json json;
  json["scene"] = name_;
  json["bodies"] = info_.bodies;
  json["fixed_bodies"] = fixed_bodies_;
  json["frames"] = step_seconds_.size();
  json["dt"] = dt_;
  json["threads"] = settings_.threads;
  json["model"] = NameOf(settings_.model);
  json["cone"] = NameOf(settings_.cone);
  json["effort"] = NameOf(settings_.effort);
  json["bounce"] = NameOf(settings_.bounce_law);
  json["tolerance"] = settings_.tolerance;
  json["freeze"] = NameOf(settings_.freezing);
  json["rungs"] = Json::array();
  for (int r = 0; r < qp::kNumRungs; ++r)
    if (settings_.ladder.Has(static_cast<qp::Rung>(r))) json["rungs"].push_back(qp::kRungNames[r]);
  json["seed"] = info_.seed;
  json["stopped_by"] = stopped_by_;
  json["sim_seconds"] = sim_seconds_;
  json["wall_seconds"] = wall_seconds_;
  json["ms_per_frame"] = {{"mean", 1e3 * sum / frames},
                          {"median", 1e3 * Quantile(step_seconds_, 0.5)},
                          {"p99", 1e3 * Quantile(step_seconds_, 0.99)},
                          {"max", 1e3 * Quantile(step_seconds_, 1)}};
  json["stage_seconds"] = {{"detect", stages_.detect},
                           {"islands", stages_.islands},
                           {"pq", stages_.pq},
                           {"collision_qp", stages_.collision_qp},
                           {"static_qp", stages_.static_qp},
                           {"freeze", stages_.freeze},
                           {"move", stages_.move}};
  json["contacts"] = mean_max(contacts_);
  json["active_contacts"] = mean_max(active_contacts_);
  json["islands"] = mean_max(islands_);
  json["largest_island_contacts"] = mean_max(largest_island_);
  json["frozen"] = frozen_;
  json["awake"] = awake_;
  json["bounces"] = bounces_;
  json["woken"] = {{"sum", woken_}, {"max", woken_max_}};
  json["restitution_lowered"] = restitution_lowered_;
  json["collision_qp"] = QpJson(collision_qp_, frames);
  json["static_qp"] = QpJson(static_qp_, frames);
  json["ladder"] = LadderJson(ladder_, 0, qp::kNumProblemRungs);
  json["certificate"] = CertificateJson(certificate_);
  json["frozen_imbalance"] = frozen_imbalance_;
  json["penetration"] = {{"max", penetration_.max},
                         {"mean_of_frame_max", penetration_.sum / frames},
                         {"max_over_smallest_size", penetration_.max / info_.smallest_size}};
  json["motion"] = {{"passes_max", motion_passes_max_},
                    {"failures", motion_failures_},
                    {"gave_up", {{"frames", gave_up_}, {"bodies_max", gave_up_max_}}},
                    {"ladder", LadderJson(motion_ladder_, qp::kNumProblemRungs, qp::kNumRungs)}};
  json["kinetic_energy_end"] = kinetic_energy_;
  const auto entry = [&](const LedgerEntry& e, int place) {
    return islet::Json{{"value", e.value}, {"frame", ledger_frames_[place]}, {"body", e.body}};
  };
  json["ledger"] = {{"energy_created", entry(ledger_.energy_created, 0)},
                    {"momentum_unexplained", entry(ledger_.momentum_unexplained, 1)},
                    {"angular_momentum_unexplained", entry(ledger_.angular_momentum_unexplained, 2)},
                    {"displacement_without_velocity", entry(ledger_.displacement_without_velocity, 3)},
                    {"sides_changed", ledger_.sides_changed}};
  json["failed_steps"] = failed_steps_;
  json["energy_gain_max"] = energy_gain_max_;
  json["mechanical_energy_gain"] = mechanical_energy_gain_;
  json["momentum_drift"] = isolated ? islet::Json(momentum_drift_) : islet::Json(nullptr);
  json["escaped"] = escaped_;
  json["passed"] = info_.passed_z ? islet::Json(passed_) : islet::Json(nullptr);
  json["state_hash"] = state_hash_;
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string RunReport::Summary() const {
  const double frames = std::max<double>(1, static_cast<double>(step_seconds_.size()));
  double sum = 0;
  for (const double seconds : step_seconds_) sum += seconds;
  const auto qp = [](const QpSummary& q) {
    return fmt::format("{} solved, {} failed, {} missed the tolerance ({:.2g} %), worst map {:.1e} v_ref", q.solved,
                       q.failed, q.missed, 1e2 * q.missed / std::max(1, q.solved), q.worst_map);
  };
  std::string text =
      fmt::format("{}: {}, {} frames of {:.4g} s, {} threads, stopped by {}\n", name_, CountedBodies(info_.bodies),
                  step_seconds_.size(), dt_, settings_.threads, stopped_by_);
  text += fmt::format("  time          {:.2f} s for {:.2f} s; {:.2f} ms a frame, median {:.2f}, slowest {:.2f}\n",
                      wall_seconds_, sim_seconds_, 1e3 * sum / frames, 1e3 * Quantile(step_seconds_, 0.5),
                      1e3 * Quantile(step_seconds_, 1));
  text += fmt::format("  contacts      {:.0f} on average, {:.0f} at most; {:.0f} active on average\n",
                      contacts_.sum / frames, contacts_.max, active_contacts_.sum / frames);
  text += fmt::format("  collision QP  {}\n  static QP     {}\n", qp(collision_qp_), qp(static_qp_));
  text += fmt::format(
      "  certificate   momentum {:.1e}, cone {:.1e}, dual {:.1e}, gap {:.1e}; exact Coulomb {:.1e} m/s rms\n",
      certificate_.momentum, certificate_.cone, certificate_.dual, certificate_.gap, certificate_.coulomb_map_rms);
  text += fmt::format(
      "  ledger        energy created {:.1e} of that at hand, momentum {:.1e}, angular {:.1e}, way {:.1e} m, sides {}; "
      "{} steps failed\n",
      ledger_.energy_created.value, ledger_.momentum_unexplained.value, ledger_.angular_momentum_unexplained.value,
      ledger_.displacement_without_velocity.value, ledger_.sides_changed, failed_steps_);
  text += fmt::format("  penetration   {:.2e} m at most\n", penetration_.max);
  text += fmt::format("  at the end    {} frozen, {} awake, kinetic energy {:.3g} J", frozen_, awake_, kinetic_energy_);
  if (info_.passed_z) text += fmt::format(", {} passed", passed_);
  if (info_.bounds) text += fmt::format(", {} escaped", escaped_);
  text += fmt::format("\n  state hash    {}\n  expected      {}\n", state_hash_, Printable(expected_));
  return text;
}

std::string RunReport::Warning() const {
  if (failed_steps_ == 0) return "";
  return fmt::format("{} of {} steps failed, the first is frame {} ({})", failed_steps_, step_seconds_.size(),
                     first_failed_, why_failed_);
}

}  // namespace islet
