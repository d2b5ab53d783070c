// The interior point as the cascade asks it: small islands as exactly as iterations get.
#pragma once

#include <algorithm>
#include <span>

#include "qp/cascade/task.h"
#include "qp/interior_point/interior_point.h"
#include "qp/smallness.h"
#include "qp/solution.h"

namespace islet::qp {

class ConvexSolver {
 public:
  void Begin() { iterations_ = 0; }
  void Solve(const Problem& problem, const Settings& settings, std::span<const double> slips, Solution* solution) {
    Settings inner = settings;
    // Near a gap of 1e-15 rounding of the sliding contacts moves redundant impulses off the centre of the right ones.
    if (IsSmall(problem)) inner.aim = settings.aim > 0 ? std::min(settings.aim, kExact) : kExact;
    interior_point_.Solve(problem, inner, slips, solution);
    solution->rung = Rung::kInteriorPoint;
    iterations_ += solution->iterations;
  }
  int iterations() const { return iterations_; }  // since Begin

 private:
  InteriorPoint interior_point_;
  int iterations_ = 0;
};

}  // namespace islet::qp
