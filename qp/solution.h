// What an island solve returns.
#pragma once

#include <cstdint>
#include <vector>

#include "qp/ladder.h"
#include "qp/problem.h"

namespace islet::qp {

// How a solve ended.
enum class Status : std::uint8_t {
  kSolved,      // to the tolerance
  kInaccurate,  // stopped early (no further progress, or the effort is spent); the answer is the best point found
  kInfeasible,  // no velocities satisfy the contacts; the answer is not usable as it is
  kFailed,      // no finite answer
};
const char* ToString(Status status);  // "solved" and the like

struct Solution {
  Status status = Status::kFailed;  // how it ended
  std::vector<double> velocities;   // 6 per body; always v0 + M^-1 J^T j
  std::vector<Vector3> impulses;    // per contact, (n, t1, t2)
  std::vector<double>
      slips;  // per contact: the De Saxce term s = mu |u_t| that the solved problem used; 0 unless kCoulomb
  // kKinetic with bounce targets only, else empty: p (6 per body), the multiplier of the momentum balance, and gamma >= 0
  // (one per contact), that of u_n >= target; M (v - p) = N^T gamma.
  std::vector<double> multipliers;
  std::vector<double> bounce_multipliers;  // gamma
  int iterations = 0;                      // factorisations, all together
  double gap = 0;                          // relative duality gap reached
  Rung rung = Rung::kNothing;              // that the answer came from
};

}  // namespace islet::qp
