// Primal-dual interior-point method for a dense DenseProblem: Nesterov-Todd scaling, Mehrotra's predictor-corrector and
// centrality correctors, as for islands (interior_point.h).
//
//   find v, z:  v = A^T j,  s = T (A v + c),  j = T^T z,  s o z = 0,  with s, z in the cones of cone.h and W = A A^T
//
// v has as many numbers as W has rank. Every iteration factorises S = I + A^T D A, which is positive definite however
// redundant the contacts are. Iterates on while that makes progress: what the answer lacks is then rounding.
//   threads: one caller at a time
#pragma once

#include <vector>

#include <Eigen/Cholesky>

#include "qp/cone.h"
#include "qp/dense/dense_gram.h"
#include "qp/dense/dense_problem.h"

namespace islet::qp {

class DenseInteriorPoint {
 public:
  struct Result {
    int iterations = 0;
    double gap = 0;           // s . z per contact, scaled units
    double residual = 0;      // largest violation of the linear equations, scaled units
    bool infeasible = false;  // the impulses prove that velocities which satisfy the contacts would need absurd energy
  };
  // offset: c, 3 numbers a contact, scaled. `impulses`: j, scaled.
  Result Solve(const ScaledDenseProblem& problem, Cone cone, int max_iterations, const Eigen::VectorXd& offset,
               Eigen::VectorXd* impulses);

 private:
  struct Rows {
    int first;
    ContactCone cone;
  };
  void Load(const ScaledDenseProblem& problem, Cone cone, const Eigen::VectorXd& offset);
  Eigen::VectorXd Impulses(const Eigen::VectorXd& z) const;
  bool ProveInfeasible() const;
  bool Factorise();
  void ComputeDirection(double weight);
  void AimAt(double goal);
  bool ImproveCentrality(double weight, double aim, double* step);
  double LongestStep(double limit) const;
  void Advance(double step);
  Scaling ScalingOf(size_t c) { return {&point_[rows_[c].first], &lambda_[rows_[c].first], eta_[c]}; }

  const Eigen::MatrixXd* a_ = nullptr;
  std::vector<Rows> rows_;
  int num_rows_ = 0, degree_ = 0;
  Eigen::VectorXd offset_, v_, s_, z_, point_, lambda_;
  std::vector<double> eta_;
  Eigen::VectorXd primal_, dual_;          // s - T (A v + c); v - A^T j
  Eigen::VectorXd target_, dv_, ds_, dz_;  // direction; all but dv in scaled space
  DenseGram gram_;
  std::vector<Matrix3> weights_;  // D per contact
  Eigen::MatrixXd system_;        // S
  Eigen::LLT<Eigen::MatrixXd> factors_;
};

}  // namespace islet::qp
