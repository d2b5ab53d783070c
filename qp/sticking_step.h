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

// Of mu j_n: what presses with a larger tangential impulse slides, or may.
inline constexpr double kInsideCone = 0.98;

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

// D, one block a contact: the inverse Hessian of the barrier -log((mu j_n)^2 - |j_t|^2) of its cone, scaled such that the mean
// of all is kStiffness / W; zero where nothing presses. scales: 1 / W.
void StickingMetric(const Problem& problem, const std::vector<Vector3>& impulses, const std::vector<double>& scales,
                    std::vector<Matrix3>* metric);

}  // namespace islet::qp
