// A contact problem without bodies: contact velocities as a linear function of the impulses, u = W j + q.
//
//   W    symmetric, positive semidefinite up to rounding, dense; its rank may be far below its size
//   law  between j and u: qp::Model, without bounces; blocks of 3, normal first
//
// What others hand over when they have eliminated their bodies, or when their mass matrix is not one of rigid bodies.
#pragma once

#include <vector>

#include "qp/solution.h"

namespace islet::qp {

struct DenseProblem {
  Eigen::MatrixXd delassus;      // W, 3n x 3n
  Eigen::VectorXd velocity;      // q: of the contacts without impulses
  std::vector<double> friction;  // mu >= 0

  int num_contacts() const { return static_cast<int>(friction.size()); }

  // Throws std::invalid_argument that names the field, its place and the value.
  void Validate() const;
};

struct DenseSolution {
  Status status = Status::kFailed;
  Eigen::VectorXd impulses;    // j
  Eigen::VectorXd velocities;  // u = W j + q
  int iterations = 0;          // factorisations
};

// The problem in units in which every contact has tr W_cc = 3 and velocities are of order one: scaled W = D W D with one
// number d per contact, u = unit u_scaled / d, j = unit d j_scaled. Friction cones stay what they are.
struct ScaledDenseProblem {
  explicit ScaledDenseProblem(const DenseProblem& problem, double velocity_scale);

  int num_contacts() const { return static_cast<int>(friction.size()); }
  // Of a scaled velocity of this contact, over the velocity scale.
  double RelativeSpeed(int contact) const { return unit / (scale[contact] * velocity_scale); }

  Eigen::MatrixXd delassus;
  Eigen::MatrixXd factor;  // A with W = A A^T to rounding; as many columns as W has rank
  Eigen::VectorXd velocity;
  std::vector<double> friction, scale;
  double unit, velocity_scale;
};

}  // namespace islet::qp
