// The Newton matrix of the interior-point method, reduced to the bodies.
//
// One field (convex models), unknown v:            Two fields (kinetic model), unknowns v and p = multiplier of momentum:
//   S = M + sum_c J_c^T D_c J_c                       S = [ M + sum_c N_c^T E_c N_c        -M              ]
//                                                         [ -M                   - sum_c J_c^T D_c J_c     ]
//   6x6 blocks, positive definite                     12x12 blocks per pair of bodies, quasi-definite
//
// D_c (3x3) is the scaling of contact c's friction cone, E_c (a number) that of its row u_n >= b, N_c the normal row of
// J_c. Both fields of a body stay together, so the graph is that of the contacts either way.
//   threads: one caller at a time; allocation only in Prepare
#pragma once

#include <array>
#include <vector>

#include "qp/block_cholesky.h"
#include "qp/problem.h"

namespace islet::qp {

class KktSystem {
 public:
  // Symbolic phase; kept while the graph of the problem is the same. num_fields: 1 or 2.
  void Prepare(const Problem& problem, int num_fields);

  // D: one block per contact. E: one number per contact, unused with one field. Returns the number of pivots that had
  // to be replaced (0 in a healthy factorisation).
  int Factorise(const Problem& problem, const std::vector<Matrix3>& d, const std::vector<double>& e);

  // x <- S^-1 x; unknowns body by body, field by field: x[(6 num_fields) body + 6 field + i].
  void Solve(double* x) { cholesky_.Solve(x); }

  int num_fields() const { return num_fields_; }
  const BlockCholesky& cholesky() const { return cholesky_; }

 private:
  int num_fields_ = 1;
  BlockCholesky cholesky_;
  std::vector<std::array<int, 2>> pairs_;  // scratch: pairs of bodies in contact
  std::vector<BlockPlace> diagonal_;       // per body
  std::vector<BlockPlace> off_diagonal_;   // per contact; data null if one side is immovable
};

}  // namespace islet::qp
