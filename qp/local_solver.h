// Solves a LocalProblem, model by model:
//   convex    the interior point; on the circular cone finished by Newton's method
//   coulomb   circular: interior point with lagged slip s = mu |u_t|, Gauss-Seidel sweeps, Newton's finish, in rounds until the
//             natural map of exact Coulomb is below the tolerance; the best round is kept [DS91, ACLM11]
//             octagon: interior point with lagged slip
//
//   threads: one caller at a time
#pragma once

#include "qp/local_interior_point.h"
#include "qp/local_newton.h"
#include "qp/local_problem.h"

namespace islet::qp {

class LocalSolver {
 public:
  // The problem must be valid. settings.tolerance is that of the natural map of the model: rms over the contacts, over the velocity
  // scale, and ten times that at any contact.
  void Solve(const LocalProblem& problem, const Settings& settings, LocalSolution* solution);

 private:
  void SolveConvex(const ScaledLocalProblem& problem, const Settings& settings, LocalSolution* solution);
  void SolveCoulomb(const ScaledLocalProblem& problem, const Settings& settings, LocalSolution* solution);
  void SolveCoulombOctagon(const ScaledLocalProblem& problem, const Settings& settings, LocalSolution* solution);

  LocalInteriorPoint interior_point_;
  LocalNewton newton_;
};

}  // namespace islet::qp
