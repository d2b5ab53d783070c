// Exact Coulomb friction on the octagon: convex problems, each with the slips of the answer before [ACLM11]. With the right slips the
// problem is the exact one.
//
//   threads: one per worker
#pragma once

#include <vector>

#include "qp/cascade/convex_solver.h"
#include "qp/cascade/task.h"
#include "qp/solution.h"

namespace islet::qp {

class SlipRounds {
 public:
  void Solve(const Task& task, ConvexSolver* convex, Solution* solution);

 private:
  double UpdateSlips(const Problem& problem, Cone cone);

  std::vector<double> slips_;
  Solution trial_;
};

}  // namespace islet::qp
