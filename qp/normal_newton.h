// Contacts without friction, by Newton's method on the augmented Lagrangian: one or two factorisations from impulses that are
// nearly right, where the interior point takes ten.                                                  [Roc76, QS06]
//
//   round: least over v of  1/2 |v - v0|_M^2 + sum_c j_c^2 / (2 sigma_c),  j_c = max(0, j'_c - sigma_c (n_c . v + b_c)),
//          by Newton's method with a line search; its j is the j' of the next round
//   end:   the natural map |j - max(0, j - rho u)| / rho is below the goal at every contact
//
// The function is piecewise quadratic, so that a round ends at rounding after finitely many steps. Contacts that cannot all be
// satisfied have no answer; the method gives up then.
//   threads: one caller at a time, idle workers help with the factorisation; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/normal_system.h"
#include "qp/problem.h"

namespace islet::qp {

class NormalNewton {
 public:
  // The problem's friction is taken for zero; no compliance. goal: [velocity] natural map.
  // impulses: where to start, normal parts only. Returns whether the answer was reached; impulses hold it then, or whatever
  // was reached.
  bool Solve(const Problem& problem, double goal, int max_factorisations, std::vector<Vector3>* impulses);

  int factorisations() const { return factorisations_; }  // of the last call

 private:
  // One contact, by the normal row of its Jacobian.
  struct Row {
    int a, b;  // bodies, -1 if immovable
    Vector6 normal_a, normal_b;
    double offset;  // b: drift less target
    double rho, sigma, rest, speed, change, impulse;
  };
  void Load(const Problem& problem, const std::vector<Vector3>& impulses);
  void SetConsistentVelocities();
  double SpeedOf(const Row& row, const std::vector<double>& velocities) const;
  void UpdateSpeeds();
  double Evaluate();
  double WorstMap() const;
  bool Minimise(double goal, int max_factorisations);
  double SlopeAt(double step) const;
  double SearchLine() const;

  NormalSystem system_;
  int factorisations_ = 0, width_ = 6;
  double total_mass_ = 0;
  std::vector<Row> rows_;
  std::vector<double> free_, v_, gradient_, step_, scratch_;  // width_ per body
  std::vector<double> sigmas_;                                // per contact: sigma, 0 where it is open
  const Problem* problem_ = nullptr;                          // during Solve
};

}  // namespace islet::qp
