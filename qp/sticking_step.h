// One linear step for impulses that all lie strictly inside their friction cones: then the law asks for u = target n at
// every contact that presses, and nothing bounds the change of its impulse but the cone's border, which is far away.
//
//   least   |u + J dv|^2 in D + |dv|^2 in M,   dj = -D (u + J dv),   so that M dv = J^T dj
//
// D is large beside 1 / W, so that next to nothing of u is left, and it is measured in the cone's barrier: contacts change
// in proportion to what they bear, and what bears nothing stays as it is. Where they bear little D is not so large: the
// same factors are used again.
//   threads: one caller at a time, idle workers help with the factorisation; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/kkt.h"
#include "qp/problem.h"

namespace islet::qp {

class StickingStep {
 public:
  // Whether every contact that presses is strictly inside its cone.
  static bool Fits(const Problem& problem, const std::vector<Vector3>& impulses);

  // Where it fits. scales: 1 / W, one number a contact. goal: [velocity] what may be left at a contact. Changes impulses
  // and velocities, which must satisfy M (v - v0) = J^T j before and do so after.
  void Take(const Problem& problem, const std::vector<double>& scales, double goal, std::vector<Vector3>* impulses,
            std::vector<double>* velocities);

 private:
  double FindMisses(const Problem& problem, const std::vector<Vector3>& impulses,
                    const std::vector<double>& velocities);

  KktSystem system_;
  std::vector<Matrix3> metric_;  // D, per contact
  std::vector<Vector3> misses_;  // u - target n, per contact
  std::vector<double> change_;   // dv, 6 numbers a body
};

// Inverse Hessian of the barrier -log((mu j_n)^2 - |j_t|^2) of a friction cone, up to a factor of 2. mu > 0
Matrix3 ConeMetric(const Vector3& impulse, double friction);

// Mean of |j|^2 times W: what makes D of ConeMetric a multiple of 1 / W.
double MeanLoad(const std::vector<Vector3>& impulses, const std::vector<double>& scales);

}  // namespace islet::qp
