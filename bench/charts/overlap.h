// How far bodies overlap, from their poses alone: our own code, which no engine under test runs.
//
// Boxes and hulls: separating axes; the overlap is the least along any of them, which is exact. Sphere
// and box: distance from the centre to the box. Two spheres: distance of the centres.
//   in:  plan and poses    out: [m] positive where two bodies overlap, over all pairs of which one moves    threads: const
#pragma once

#include <span>

#include "bench/peers/peer.h"

namespace islet::charts {

struct Overlap {
  double deepest = 0;  // [m]
  double sum = 0;      // [m] over the pairs that overlap by more than a micrometre
  int pairs = 0;       // of those
};

double PairOverlap(const peers::BodyPlan& a, const peers::State& at_a, const peers::BodyPlan& b,
                   const peers::State& at_b);  // [m] negative or 0: apart; how far apart is not exact

Overlap MeasureOverlap(const peers::WorldPlan& plan, std::span<const peers::State> states);

}  // namespace islet::charts
