// The Newton matrix of contacts without friction, S = M + sum_c sigma_c n_c n_c^T, n_c the normal row of J_c.
//
// Spheres cannot be turned without friction: if no normal has a lever arm, the unknowns are the three translations of each
// body, and a factorisation takes an eighth of the work.
//   threads: one caller at a time, idle workers help with the factorisation; allocates only in Prepare, while problems grow
#pragma once

#include <array>
#include <vector>

#include "qp/block_cholesky.h"
#include "qp/problem.h"
#include "qp/supernode_parts.h"

namespace islet::qp {

class NormalSystem {
 public:
  // Keeps the symbolic phase while the graph of the problem is the same. Takes the masses and the normals.
  void Prepare(const Problem& problem);

  // Unknowns per body: 3 or 6.
  int width() const { return width_; }

  // sigma: one per contact, 0 where the contact is open.
  // Returns the number of pivots that had to be replaced (0 in a healthy factorisation).
  int Factorise(const std::vector<double>& sigma);

  // x <- S^-1 x, width() numbers a body.
  void Solve(double* x) { cholesky_.Solve(x); }

  const BlockCholesky& cholesky() const { return cholesky_; }

 private:
  template <int kWidth>
  int FactoriseIn(const std::vector<double>& sigma);

  int width_ = 6;
  BlockCholesky cholesky_;
  std::vector<std::array<int, 2>> pairs_;
  std::vector<double> normals_;    // 12 per contact: of body a, of body b
  std::vector<Matrix3> inertias_;  // per body
  std::vector<double> masses_;     // per body
  SupernodeParts<const double*> parts_;
};

}  // namespace islet::qp
