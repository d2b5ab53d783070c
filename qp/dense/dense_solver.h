// Solves a DenseProblem on the circular cone: Gauss-Seidel sweeps and Newton's method by turns until the natural map of the model is
// below the tolerance; the best impulses are kept [JAJ98, AC91]. Convex and exact Coulomb friction alike.
//
//   threads: one caller at a time
#pragma once

#include "qp/dense/dense_newton.h"
#include "qp/dense/dense_problem.h"

namespace islet::qp {

class DenseSolver {
 public:
  // The problem must be valid. settings.tolerance is that of the natural map of the model: rms over the contacts, over the velocity
  // scale, and ten times that at any contact.
  void Solve(const DenseProblem& problem, const Settings& settings, DenseSolution* solution);

 private:
  void SolveScaled(const ScaledDenseProblem& problem, const Settings& settings, DenseSolution* solution);

  DenseNewton newton_;
};

}  // namespace islet::qp
