// The convex contact problem on circular cones in the form that solvers without knowledge of rigid bodies take:
//
//   least 1/2 v^T M v + w^T j   with   M v = f + H j,   j_c in K_c = { |j_t| <= mu j_n }
//
// which is FCLIB's global form. A problem without bodies, u = W j + q, becomes one with M = I and H = A^T, W = A A^T.
//   errors: FclibError if W is not positive semidefinite, beyond rounding
#pragma once

#include <Eigen/Core>

#include "scenes/fclib_file.h"

namespace islet::studies {

struct GeneralProblem {
  SparseMatrix mass;      // M, n x n
  SparseMatrix coupling;  // H, n x 3m
  Eigen::VectorXd load;   // f
  Eigen::VectorXd drift;  // w
  Eigen::VectorXd friction;

  int num_unknowns() const { return static_cast<int>(mass.rows()); }
  int num_contacts() const { return static_cast<int>(friction.size()); }
};

GeneralProblem MakeGeneral(const FclibProblem& file);  // with a symmetric M or W

struct GeneralAnswer {
  bool solved = false;  // as the solver sees it
  int iterations = 0;
  Eigen::VectorXd v, j;
};

// The answer's v is replaced by M^-1 (f + H j): accuracy is then that of j alone, as in islet, whose momentum is exact.
void RestoreMomentum(const GeneralProblem& problem, GeneralAnswer* answer);

}  // namespace islet::studies
