// What a run did, from the poses and velocities that an engine reports, 30 times a simulated second: overlap, ledgers of
// energy and momentum, Coulomb's law, drift, creep, jitter, lost bodies. Shares no code with any engine.
//
//   use: one Judge a run; Sample() at the start and after each thirtieth of a second, and before it SampleStep() with the
//        states before and after the last step if WantsStep(); then Result()
//   errors: states that are not finite count as lost, and end what can be measured
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "bench/charts/coulomb_error.h"
#include "bench/peers/peer.h"

namespace islet::charts {

inline constexpr int kSamplesPerSecond = 30;

struct Measures {
  double overlap_max = 0;     // [m] over all samples but the first
  double overlap_mean = 0;    // [m] mean over the samples of the deepest overlap in each
  double overlap_end = 0;     // [m] deepest in the last second
  double drift = 0;           // [m] farthest that a centre is at the end from where it began
  double drift_max = 0;       // [m] the same at any time
  double creep = 0;           // [m] farthest that a centre moved in the last second
  double coulomb_error = -1;  // mean over bodies and steps that were judged (coulomb_error.h); -1: none was
  double coulomb_end = -1;    // the same over the last second
  double coulomb_told = -1;   // the same over the run with motion that no velocity tells left out
  double coulomb_judged = 0;  // share of the touching bodies, over the steps looked at, that were judged
  double jitter = 0;          // [m/s] root mean square speed of the centres in the last second
  double kinetic_end = 0;     // [J]
  double energy_gain = 0;     // [J] sum of all rises of the total energy from one sample to the next
  double energy_ratio = 0;    // total at the end over that at the start, where nothing takes or gives energy; else 0
  double momentum_error = 0;  // [N s] change of the total momentum, where nothing but contacts acts; else 0
  double fell_at = -1;        // [s] first sample in which a centre is 0.3 m below its start; -1: never
  int lost = 0;               // bodies that are outside the bounds or not finite at the end
  bool finite = true;
};

class Judge {
 public:
  explicit Judge(const peers::WorldPlan& plan);

  // Large worlds: one sample in 20, for the judge's own time. False where there is no gravity, or nothing but collisions.
  bool WantsStep() const;
  void SampleStep(double time, std::span<const peers::State> before, std::span<const peers::State> after, double dt);
  void Sample(double time, std::span<const peers::State> states);
  Measures Result() const;
  std::span<const peers::State> last() const { return last_; }
  std::uint64_t StateHash() const;  // FNV-1a over the bits of the last states

 private:
  double Energy(std::span<const peers::State> states, double* kinetic) const;  // [J]
  Vector3 Momentum(std::span<const peers::State> states) const;                // [N s]
  bool Isolated() const;                                                       // no gravity, nothing static
  bool Lossless() const;                                                       // no friction, restitution 1
  void IncludeInLastSecond(double time, double deepest, std::span<const peers::State> states);

  struct Recent {  // one sample of the last second
    double time, deepest, squared_speed;
    std::vector<Vector3> centres;
  };

  struct Step {
    double time, error, told;  // [s], 1, 1
    int judged;                // bodies
    int candidates;            // bodies
  };

  const peers::WorldPlan& plan_;
  std::optional<CoulombMeter> coulomb_;
  int steps_apart_ = 1;  // samples
  std::vector<Step> steps_;
  Measures measures_;
  int samples_ = 0;
  double overlap_sum_ = 0, energy_ = 0, start_energy_ = 0;
  Vector3 start_momentum_ = Vector3::Zero();
  std::vector<peers::State> last_;
  std::vector<Recent> recent_;
};

}  // namespace islet::charts
