#include "scenes/verify/check.h"
#include "scenes/verify/impact_family.h"

namespace islet {

std::span<const Check> ImpactChecks() {
  using namespace verify;
  static constexpr Check kChecks[] = {
      {"T10", "bouncing ball", Gate::kGate,
       "peak e^(2 n) h0 (Newton's law and free fall); with e < 1 at rest after sqrt(2 h0 / g) (1 + e) / (1 - e), the "
       "sum of all flights",
       MeasureBouncingBall},
      {"T11", "cube dropped flat, on a floor and on a pedestal", Gate::kGate,
       "returns to its height without spin: its corners hit at once, by symmetry", MeasureBouncingCube},
      {"T12", "cradle", Gate::kGate,
       "k balls in, k balls out; with unequal masses each ball hits the next, v' = 2 m v / (m + m')", MeasureCradle},
      {"T13", "ball against two that touch (Bernoulli)", Gate::kChart,
       "-v/5, and 2 sqrt(3)/5 v at 30 degrees: momentum and energy with impulses along the lines of centres",
       MeasureSymmetricHit},
      {"T31", "isolated cloud", Gate::kGate,
       "momentum and angular momentum stay, energy never grows, and stays if e = 1 and mu = 0: Newton's third law",
       MeasureCloud},
      {"T32", "lattice of 6 x 6 x 6 spheres falls on a floor (SimBenchmark's 666)", Gate::kChart,
       "no overlap; with e = 1 and mu = 0 the energy stays", MeasureSphereLattice},
  };
  return kChecks;
}

}  // namespace islet
