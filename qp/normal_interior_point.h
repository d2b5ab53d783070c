// Contacts without friction, by an interior point of its own: one row and two numbers a contact, no cones, and a start from
// impulses that are roughly right.
//
//   find v, j >= 0, s >= 0:  M (v - v0) = sum_c j_c n_c,  s_c = n_c . v + b_c,  j_c s_c = 0,  b = drift less target
//   by Mehrotra's predictor-corrector with Gondzio's centrality correctors                                  [Gon96]
//
// The start: of an impulse j and a speed u across the same contact, x = j / rho - u says how closed it is [velocity]. The point
//   s = (sqrt(x^2 + 4 m^2) - x) / 2,  j = rho (sqrt(x^2 + 4 m^2) + x) / 2
// has s j = rho m^2. With the same product at all contacts it is perfectly centred, and off the balances by little more than m.
//   threads: one caller at a time, idle workers help with the factorisation; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/normal_system.h"
#include "qp/problem.h"
#include "qp/settings.h"

namespace islet::qp {

class NormalInteriorPoint {
 public:
  // The problem's friction is taken for zero; no compliance. velocities, 6 a body, and impulses (normal parts): where to start;
  // they need not belong together. map [velocity]: how far they are from the law (natural map, rms).
  // Returns whether gap and violations are below settings.tolerance; impulses hold the answer then, or whatever was reached.
  // False, too, where there is no answer.
  bool Solve(const Problem& problem, const Settings& settings, double map, const std::vector<double>& velocities,
             std::vector<Vector3>* impulses);

  int factorisations() const { return factorisations_; }  // of the last call
  double gap() const { return gap_; }                     // relative, of the last call

 private:
  // One contact. An immovable side is body n of n, whose velocity stays zero.
  struct Row {
    int a, b;
    double normal[12];  // of a and of b, width each
    double offset, rho;
    double s, impulse, primal;  // primal: s - n . v - b
    double ds, dj, product;     // the direction; what of its second order the next one takes off s j
    double kept_ds, kept_dj, kept_product;
  };
  void Load(const Problem& problem, double velocity_scale);
  void ChooseStart(const Settings& settings, double map, const std::vector<double>& velocities,
                   const std::vector<Vector3>& impulses);
  template <int kWidth>
  bool Iterate(const Settings& settings);
  template <int kWidth>
  double UpdateResiduals();
  template <int kWidth>
  double ComputeDirection(double goal);
  template <int kWidth>
  double ImproveCentrality(double goal, double reach);
  double BalanceError() const;

  const Problem* problem_ = nullptr;  // during Solve
  NormalSystem system_;
  int width_ = 6, factorisations_ = 0;
  double energy_ = 0, mass_ = 0, gap_ = 0;
  std::vector<Row> rows_;
  std::vector<double> free_, v_, pull_, error_, dv_, kept_dv_;  // width_ per body; pull: M (v - v0)
  std::vector<double> sigmas_;                                  // per contact
};

}  // namespace islet::qp
