// Gauss-Seidel sweeps over contacts without friction, with momentum [Nes83]: one row and one number a contact, in the order of
// the problem. They bring methods of second order to a good start; answers they reach in small islands alone.
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/problem.h"

namespace islet::qp {

class NormalSweeps {
 public:
  // The problem's friction is taken for zero; no compliance. impulses and velocities (6 a body) must satisfy
  // M (v - v0) = sum_c j_c n_c before, and do so after; of impulses only the normal parts are used. Stops where the largest change
  // of a speed falls below `tolerance` [velocity]. Returns the number of sweeps.
  int Sweep(const Problem& problem, int max_sweeps, double tolerance, std::vector<Vector3>* impulses,
            std::vector<double>* velocities);

 private:
  // One contact. An immovable side is body n of n, whose velocity stays zero.
  struct Row {
    int a, b;
    double normal[12], response[12];  // n and M^-1 n: of a and of b, width each
    double offset, rho;               // drift less target; 1 / W_nn
    double impulse, previous;         // after the last sweep, and after the one before
  };
  struct Sums {
    double largest = 0;            // change of an impulse over rho [velocity]
    double change = 0, ahead = 0;  // |x - z|^2; (x - z) . (x - previous), negative where momentum led astray
  };
  void Load(const Problem& problem, const std::vector<Vector3>& impulses, const std::vector<double>& velocities);
  template <int kWidth>
  Sums SweepOnce(double momentum);
  void Extrapolate(double momentum);

  int width_ = 6;  // 3 where no normal has a lever arm
  std::vector<Row> rows_;
  std::vector<double> velocities_, previous_;  // width_ per body, and of what stands still
};

}  // namespace islet::qp
