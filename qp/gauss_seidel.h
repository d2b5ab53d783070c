// Projected block Gauss-Seidel for exact Coulomb friction: visits the contacts in order and solves each exactly with the
// others held. Cheap per sweep and good at local stick-slip, slow to carry loads across a pile. Here it polishes what the
// interior point left, and finds the slips of the next round.                                             [JAJ98]
//
//   deterministic: contacts in the order of the problem
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/one_contact.h"
#include "qp/problem.h"

namespace islet::qp {

class GaussSeidel {
 public:
  void Prepare(const Problem& problem);

  // Sweeps until the largest change of a contact's impulse times its W_nn falls below `tolerance` [velocity], at most
  // `max_sweeps` times. impulses and velocities must satisfy M (v - v0) = J^T j before, and do so after.
  // Returns the number of sweeps.
  int Sweep(const Problem& problem, int max_sweeps, double tolerance, std::vector<Vector3>* impulses,
            std::vector<double>* velocities) const;

 private:
  struct Local {
    OneContact contact;
    Eigen::Matrix<double, 6, 3> response_a, response_b;  // M^-1 J^T
  };
  std::vector<Local> locals_;
};

}  // namespace islet::qp
