// Solves a DenseProblem, model by model:
//   convex    the interior point; on the circular cone finished by Newton's method
//   coulomb   circular: interior point with lagged slip s = mu |u_t|, Gauss-Seidel sweeps, Newton's finish, in rounds until the
//             natural map of exact Coulomb is below the tolerance; the best round is kept [DS91, ACLM11]
//             octagon: interior point with lagged slip
//
//   threads: one caller at a time
#pragma once

#include "qp/dense/dense_interior_point.h"
#include "qp/dense/dense_newton.h"
#include "qp/dense/dense_problem.h"

namespace islet::qp {

class DenseSolver {
 public:
  // The problem must be valid. settings.tolerance is that of the natural map of the model: rms over the contacts, over the velocity
  // scale, and ten times that at any contact.
  void Solve(const DenseProblem& problem, const Settings& settings, DenseSolution* solution);

 private:
  void SolveConvex(const ScaledDenseProblem& problem, const Settings& settings, DenseSolution* solution);
  void SolveCoulomb(const ScaledDenseProblem& problem, const Settings& settings, DenseSolution* solution);
  void SolveCoulombOctagon(const ScaledDenseProblem& problem, const Settings& settings, DenseSolution* solution);

  DenseInteriorPoint interior_point_;
  DenseNewton newton_;
};

}  // namespace islet::qp
