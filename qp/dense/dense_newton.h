// The finish for a dense DenseProblem: proximal steps, each solved by semismooth Newton's method.
//
//   one step, from impulses j_k:  j = L(j_k - t (A v + q)),  v = A^T j
//
// L is the exact law of a contact on a spring of stiffness t, a formula: for exact Coulomb the projection of x_n on
// x_n >= 0 and of x_t on the disc of radius mu j_n [AC91]; for the convex model that on the friction cone. A step's
// solution is that of the problem with W + I / t in place of W; repeated, the springs relax, and where they have, j is exact
// for W itself. What A misses of W is put into q from step to step. The unknown of Newton's method is v, as long as W has rank:
// redundant contacts do no harm. Converges from a good start; where it does not, it returns the best impulses it met.
//   threads: one caller at a time
#pragma once

#include <Eigen/LU>

#include "qp/dense/dense_gram.h"
#include "qp/dense/dense_problem.h"
#include "qp/natural_map.h"
#include "qp/settings.h"

namespace islet::qp {

class DenseNewton {
 public:
  // Improves impulses (scaled) until their natural map meets the goal. Returns the factorisations spent. model: kConvex or kCoulomb, circular cone.
  int Polish(const ScaledDenseProblem& problem, Model model, double goal, int max_factorisations,
             Eigen::VectorXd* impulses);

 private:
  double Residual(const Eigen::VectorXd& v);  // fills impulses_ and residual_
  void Factorise();
  bool Step(int most, int* factorisations);

  const ScaledDenseProblem* problem_ = nullptr;
  Model model_ = Model::kCoulomb;
  double stiffness_ = 1;
  Eigen::VectorXd centre_, velocity_;  // j_k - t q is split: j_k, and q with what A misses of W
  Eigen::VectorXd impulses_, residual_, pulls_;
  DenseGram gram_;
  std::vector<Matrix3> weights_;  // t G per contact
  Eigen::MatrixXd system_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factors_;
};

// Per contact |j - P_K(j - u_hat)| in scaled units, over the velocity scale; u_hat as in CoulombMap (natural_map.h) or, for
// the convex model, u.
NaturalMap NaturalMapOf(const ScaledDenseProblem& problem, Model model, const Eigen::VectorXd& impulses);

}  // namespace islet::qp
