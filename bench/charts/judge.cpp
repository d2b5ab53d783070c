#include "bench/charts/judge.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "bench/charts/overlap.h"

namespace islet::charts {
namespace {

using peers::BodyPlan;
using peers::State;

constexpr int kMostApart = 20;  // samples
constexpr double kFall = 0.3;   // [m]

bool Finite(const State& s) {
  return s.position_W.allFinite() && s.rotation_WB.coeffs().allFinite() && s.linear_velocity_W.allFinite() &&
         s.angular_velocity_W.allFinite();
}

bool Inside(const Region& region, const Vector3& point) {
  return (point.array() >= region.lower.array()).all() && (point.array() <= region.upper.array()).all();
}

}  // namespace

Judge::Judge(const peers::WorldPlan& plan) : plan_(plan) {
  const auto moving = static_cast<double>(std::ranges::count_if(plan.bodies, &BodyPlan::Moves));
  steps_apart_ = std::clamp(static_cast<int>(2 * std::sqrt(moving)) - 2, 1, kMostApart);
  if (!plan.gravity.isZero() && !Lossless()) coulomb_.emplace(plan);
}

bool Judge::WantsStep() const { return coulomb_ && measures_.finite && samples_ % steps_apart_ == 0; }

void Judge::SampleStep(double time, std::span<const State> before, std::span<const State> after, double dt) {
  if (!std::ranges::all_of(before, Finite) || !std::ranges::all_of(after, Finite)) return;
  const CoulombError error = coulomb_->Measure(before, after, dt);
  steps_.push_back({time, error.error, error.told, error.judged, error.candidates});
}

void Judge::Sample(double time, std::span<const State> states) {
  last_.assign(states.begin(), states.end());
  measures_.lost = 0;
  for (size_t i = 0; i < states.size(); ++i) {
    if (!plan_.bodies[i].Moves()) continue;
    if (!Finite(states[i])) measures_.finite = false;
    if (!Finite(states[i]) || (plan_.bounds && !Inside(*plan_.bounds, states[i].position_W))) ++measures_.lost;
  }
  if (!measures_.finite) return;

  const double energy = Energy(states, &measures_.kinetic_end);
  if (samples_++ == 0) {
    start_energy_ = energy_ = energy;
    start_momentum_ = Momentum(states);
    return;
  }
  measures_.energy_gain += std::max(0.0, energy - energy_);
  energy_ = energy;
  if (Isolated() || Lossless()) measures_.energy_ratio = energy / start_energy_;
  if (Isolated()) {
    measures_.momentum_error = (Momentum(states) - start_momentum_).norm();
  }

  const double deepest = MeasureOverlap(plan_, states).deepest;
  measures_.overlap_max = std::max(measures_.overlap_max, deepest);
  overlap_sum_ += deepest;
  measures_.drift = 0;
  for (size_t i = 0; i < states.size(); ++i) {
    if (!plan_.bodies[i].Moves()) continue;
    const Vector3 moved = states[i].position_W - plan_.bodies[i].start.position_W;
    measures_.drift = std::max(measures_.drift, moved.norm());
    if (measures_.fell_at < 0 && moved.z() < -kFall) measures_.fell_at = time;
  }
  measures_.drift_max = std::max(measures_.drift_max, measures_.drift);
  IncludeInLastSecond(time, deepest, states);
}

void Judge::IncludeInLastSecond(double time, double deepest, std::span<const State> states) {
  std::erase_if(recent_, [&](const Recent& sample) { return sample.time < time - 1 - 1e-9; });
  Recent sample{.time = time, .deepest = deepest, .squared_speed = 0, .centres = {}};
  int moving = 0;
  for (size_t i = 0; i < states.size(); ++i) {
    if (!plan_.bodies[i].Moves()) continue;
    sample.centres.push_back(states[i].position_W);
    sample.squared_speed += states[i].linear_velocity_W.squaredNorm();
    ++moving;
  }
  sample.squared_speed /= std::max(1, moving);
  recent_.push_back(std::move(sample));
}

Measures Judge::Result() const {
  Measures result = measures_;
  if (samples_ > 1) result.overlap_mean = overlap_sum_ / (samples_ - 1);
  const auto mean_since = [this](double time, double Step::*what) {
    double sum = 0, bodies = 0;
    for (const Step& step : steps_) {
      if (step.time < time) continue;
      sum += step.judged * step.*what;
      bodies += step.judged;
    }
    return bodies > 0 ? sum / bodies : -1;
  };
  if (!steps_.empty()) {
    result.coulomb_error = mean_since(0, &Step::error);
    result.coulomb_told = mean_since(0, &Step::told);
    result.coulomb_end = mean_since(steps_.back().time - 1, &Step::error);
    double judged = 0, candidates = 0;
    for (const Step& step : steps_) judged += step.judged, candidates += step.candidates;
    result.coulomb_judged = candidates > 0 ? judged / candidates : 0;
  }
  if (recent_.empty()) return result;
  double squares = 0;
  for (const Recent& sample : recent_) {
    result.overlap_end = std::max(result.overlap_end, sample.deepest);
    squares += sample.squared_speed;
  }
  result.jitter = std::sqrt(squares / static_cast<double>(recent_.size()));
  for (size_t i = 0; i < recent_.front().centres.size(); ++i) {
    result.creep = std::max(result.creep, (recent_.back().centres[i] - recent_.front().centres[i]).norm());
  }
  return result;
}

double Judge::Energy(std::span<const State> states, double* kinetic) const {
  double potential = 0;
  *kinetic = 0;
  for (size_t i = 0; i < states.size(); ++i) {
    const BodyPlan& body = plan_.bodies[i];
    if (!body.Moves()) continue;
    const Vector3 spin_B = states[i].rotation_WB.conjugate() * states[i].angular_velocity_W;
    *kinetic +=
        0.5 * body.mass * states[i].linear_velocity_W.squaredNorm() + 0.5 * spin_B.cwiseAbs2().dot(body.Inertia());
    potential -= body.mass * plan_.gravity.dot(states[i].position_W);
  }
  return *kinetic + potential;
}

Vector3 Judge::Momentum(std::span<const State> states) const {
  Vector3 sum = Vector3::Zero();
  for (size_t i = 0; i < states.size(); ++i) {
    if (plan_.bodies[i].Moves()) sum += plan_.bodies[i].mass * states[i].linear_velocity_W;
  }
  return sum;
}

bool Judge::Isolated() const { return plan_.gravity.isZero() && std::ranges::all_of(plan_.bodies, &BodyPlan::Moves); }

bool Judge::Lossless() const { return plan_.restitution == 1 && plan_.friction == 0; }

std::uint64_t Judge::StateHash() const {
  std::uint64_t hash = 0xcbf29ce484222325u;
  const auto include = [&hash](double value) {
    unsigned char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    for (const unsigned char byte : bytes) hash = (hash ^ byte) * 0x100000001b3u;
  };
  for (const State& state : last_) {
    for (int k = 0; k < 3; ++k) include(state.position_W[k]);
    for (int k = 0; k < 4; ++k) include(state.rotation_WB.coeffs()[k]);
    for (int k = 0; k < 3; ++k) include(state.linear_velocity_W[k]);
    for (int k = 0; k < 3; ++k) include(state.angular_velocity_W[k]);
  }
  return hash;
}

}  // namespace islet::charts
