// Impulses inside their cones, and the velocities that they make: what may become an answer of the exact law.
#pragma once

#include <span>
#include <vector>

#include "qp/cascade/task.h"
#include "qp/natural_map.h"
#include "qp/solution.h"

namespace islet::qp {

struct Candidate {
  std::vector<Vector3> impulses;
  std::vector<double> velocities;

  void TakeNone(const Problem& problem);
  void TakeOver(const Problem& problem, std::span<const Vector3> start);  // one per contact, of any cone
  NaturalMap MapOf(const Task& task) const;
  // Whether it has no more energy than there may be. Who says which bounces are to blame is the interior point.
  bool IsUseful(const Task& task) const;
  // Into the solution, with gap and slips; velocities must be exactly those that the impulses make.
  void Return(const Task& task, Solution* solution) const;
  // The same where the law holds to that share of the tolerance, and in other models than exact Coulomb's without slip; else the
  // solution is none.
  bool ReturnIfExact(const Task& task, double share, Solution* solution) const;
};

inline constexpr double kExactShare = 1e-3;  // of the tolerance: the gap of what is taken as it is

// No impulses, and all that goes with them.
void ReturnNone(const Problem& problem, Solution* solution);

}  // namespace islet::qp
