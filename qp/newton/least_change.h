// The smallest change of the impulses at hand, within their cones, that gives the bodies wanted momenta.
//
//   D = S P(x) S / j_n,  x = (mu j_n, j_t),  S = diag(1 / mu, 1, 1),  P(x) = 2 x x^T - det(x) diag(1, -1, -1)
//       what a contact presses with may change, what does not press stays out of it; what slides changes along its cone
//   A w = p,  A = J^T D J,  p: wanted                      [the Cholesky factor of A + a hair of mass, refined]
//   change = D J w: of those that give p the least one, measured by what the contacts press with; where it would leave a cone,
//            most of the way to there, and on with the D of these impulses                                   [affine scaling]
//
//   units: those of the problem    threads: one caller at a time, idle workers help with the factor
//   allocation: only while problems grow
#pragma once

#include <vector>

#include "qp/linear_algebra/kkt.h"
#include "qp/problem.h"

namespace islet::qp {

class LeastChange {
 public:
  // Contacts, Jacobians and friction of the problem count; its masses are set. impulses: per contact, (n, t1, t2).
  void Prepare(const std::vector<Vector3>& impulses, Problem* problem);
  // wanted: six numbers a body. limits: per body, norm of what may be missed. outside: [of an impulse] how far it may lie outside its cone.
  // change: per contact; its sum with the impulses is within the cones. Returns whether every body misses less than its limit; if not,
  // nothing is to change.
  bool Find(const std::vector<double>& wanted, const std::vector<double>& limits, double outside,
            std::vector<Vector3>* change);
  // Per body, of its limit: what the last Find missed.
  const std::vector<double>& missed() const { return missed_; }

 private:
  void Weigh(const std::vector<Vector3>& impulses);
  bool Solve(const std::vector<double>& limits);
  double ShareInCones(double outside) const;
  void Multiply(const std::vector<double>& w, std::vector<double>* aw) const;
  double Miss(const std::vector<double>& limits);

  Problem* problem_ = nullptr;  // from Prepare on
  KktSystem system_;
  bool fresh_ = false;                            // the factor is that of start_
  std::vector<Vector3> start_, impulses_, step_;  // at hand; so far; what these change by next
  std::vector<Matrix3> weights_;                  // D
  std::vector<double> missed_, wanted_, w_, residual_, correction_, image_;
};

}  // namespace islet::qp
