// The Newton matrix of a problem in the plane, S = M + sum_c J_c^T D_c J_c with three unknowns a body: components 0 and 1 of its
// velocity and 5, its spin about z (planar_problem.h).
//   threads: one caller at a time, idle workers help with the factorisation; allocates only in Prepare, while problems grow
#pragma once

#include <array>
#include <vector>

#include "qp/block_cholesky.h"
#include "qp/problem.h"
#include "qp/supernode_parts.h"

namespace islet::qp {

class PlanarSystem {
 public:
  // Takes the masses, times `mass_scale`, and the Jacobians. Keeps the symbolic phase while the graph is the same.
  void Prepare(const Problem& problem, double mass_scale);

  // D: one symmetric block per contact, of normal and first tangent; the third row is not looked at. Returns the number of pivots that had to be replaced (0 in a healthy factorisation).
  int Factorise(const std::vector<Matrix3>& d);

  // x <- S^-1 x, three numbers a body.
  void Solve(double* x) { cholesky_.Solve(x); }

  const BlockCholesky& cholesky() const { return cholesky_; }

 private:
  struct Row {
    double n[3], t[3];  // of one side of a contact
  };
  struct Mass {
    double mass, inertia;  // about z
  };

  BlockCholesky cholesky_;
  std::vector<std::array<int, 2>> pairs_;
  std::vector<Row> rows_;      // two per contact
  std::vector<Mass> masses_;   // per body
  SupernodeParts<int> parts_;  // rows: into rows_
};

}  // namespace islet::qp
