// Friction at a single contact on the octagon: the impulse lies inside the cone, on one of its eight facets, on one of its eight
// edges, or is zero. Each of these asks for one linear system; the first whose answer obeys the law is taken.
//
//   given W (3x3, positive definite) and q, find j in K with  u = W j + q  and, perpendicular to j, in K*
//     convex     u
//     coulomb    u + s n, s = mu times the octagon's support of -u_t: what presses has u_n = 0 and slides against the edges that
//                are farthest behind
//     kinetic    u - multiplier W n, where u_n >= target, and more only without a multiplier               [SM04 Eq. 13]
//   (but for kinetic q already holds the bounce target)
//
//   threads: pure functions
#pragma once

#include "qp/problem.h"

namespace islet::qp {

class OctagonContact {
 public:
  OctagonContact(const Matrix3& w, double friction);

  // False if no face has the answer: exact Coulomb may have none under Painleve's paradox.
  bool SolveConvex(const Vector3& q, Vector3* impulse) const;
  bool SolveCoulomb(const Vector3& q, Vector3* impulse) const;
  bool SolveKinetic(const Vector3& q, double target, Vector3* impulse, double* multiplier) const;

 private:
  static constexpr int kFaces = 17;  // inside, facets, edges
  // At most three by three numbers, on the stack.
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 3, 3>;

  Vector3 Edge(int k) const;
  Matrix Span(int face) const;   // impulses of the face are combinations of these columns
  Matrix Opens(int face) const;  // rows: what of u vanishes where such an impulse obeys Coulomb's law
  double Missed(const Vector3& q, const Vector3& impulse, const Vector3& dual) const;

  Matrix3 w_;
  double friction_;
};

}  // namespace islet::qp
