// Friction at a single contact on the circular cone: the smallest problem there is, solved without iteration over bodies. (On the
// octagon: octagon_contact.)
//
//   given W (3x3, positive definite) and q, find j with  u = W j + q,  K in j  perpendicular to  u + mu |u_t| n in K*
//   (q already holds the bounce target: q_n is the approach minus what is required)
//
// Separates if q_n >= 0, sticks if -W^-1 q lies in the cone, else slides: u_t = -lambda j_t with lambda > 0 the root of
// |j_t(lambda)| = mu j_n(lambda), found by bracketed Newton steps. A root exists whenever q_n < 0, also where Painleve's
// paradox would leave none on the level of forces. Never raises kinetic energy when q_n holds no bounce.
//   threads: pure functions
#pragma once

#include "qp/problem.h"

namespace islet::qp {

class OneContact {
 public:
  explicit OneContact(const Matrix3& w);

  // [impulse] (n, t1, t2).
  Vector3 SolveCoulomb(const Vector3& q, double friction) const;

  // Of the convex model: u in K*, perpendicular to j. That is exact Coulomb for a target of u_n that is mu |u_t| itself, found by
  // the false position method (Illinois); there is one, or the model had two answers. False if it is missed: under Painleve's
  // paradox exact Coulomb has several answers, between which the method may jump.
  bool SolveConvex(const Vector3& q, double friction, Vector3* impulse) const;

  // Of the kinetic model, which asks for u_n >= target > 0 (q holds no target here): of all impulses in the cone that bring that about
  // the one after which the least energy is left. multiplier: of u_n >= target, so that u - multiplier W n is in K*, perpendicular
  // to j. False if that is missed.
  bool SolveKinetic(const Vector3& q, double friction, double target, Vector3* impulse, double* multiplier) const;

  // Of all impulses in the cone after which u_n = target, above q_n, the one that leaves the least energy. In the tangential part t
  // that is a convex problem, j_n = (target - q_n - W_nt t) / W_nn; where its cone is open to infinity the answer may be missed.
  Vector3 LeastEnergy(const Vector3& q, double friction, double target) const;

  const Matrix3& w() const { return w_; }

 private:
  double SlipBeyond(double target, const Vector3& q, double friction, Vector3* impulse) const;
  Vector3 Slide(const Vector3& q, double friction) const;

  Matrix3 w_, inverse_;
  // Tangential operator with the normal eliminated, W_tt - W_tn W_nt / W_nn = axes diag(stiffness) axes^T.
  double cosine_, sine_;
  double stiffness_[2];
};

}  // namespace islet::qp
