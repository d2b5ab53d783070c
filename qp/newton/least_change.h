// The smallest change of the impulses at hand, within their cones, that gives the bodies wanted momenta.
//
//   D = S P(x) S / j_n,  x = (mu j_n, j_t),  S = diag(1 / mu, 1, 1),  P(x) = 2 x x^T - det(x) diag(1, -1, -1)
//       what a contact presses with may change, what does not press stays out of it; what slides changes along its cone
//   A w = p,  A = J^T D J,  p: wanted                      [the Cholesky factor of A + a hair of mass, refined]
//   change = D J w: of those that give p the least one, measured by what the contacts press with
//
// Where that leaves a cone, or does not give p, the impulses at hand are at the end of what they can give. Others are sought, far from
// all ends:
//
//   min  sum_c 2 j_n / m - log det(x)  over all j with J^T j = what these give + p        m: mean of j_n at hand
//   change = D J w + j - 2 D n / m,  D = S P(x) S / 2,  n: the normal      [Newton's step from what does not give it all, BV04 10.3.2]
//       almost to the boundary, where that is nearer; the step that is taken whole gives p. Where nothing asks for more, all press by m:
//       what is asked again and again does not press harder and harder
//
// Where no impulses give p, w grows without bound, along a way in which bodies can give way and no contact resists [Farkas' lemma].
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
  enum class Reach {
    kNear,  // the least change alone
    kFar    // and all other impulses, however far they are from those at hand
  };

  // Contacts, Jacobians and friction of the problem count; its masses are set. impulses: per contact, (n, t1, t2).
  void Prepare(const std::vector<Vector3>& impulses, Problem* problem);
  // wanted: six numbers a body. limits: per body, norm of what may be missed. outside: [of an impulse] how far the least change may leave
  // its cone. change: per contact; its sum with the impulses is within the cones. Returns whether every body misses less than its limit;
  // if not, nothing is to change.
  bool Find(const std::vector<double>& wanted, const std::vector<double>& limits, double outside, Reach reach,
            std::vector<Vector3>* change);
  // Per body, of its limit: what the last Find missed.
  const std::vector<double>& missed() const { return missed_; }
  // Six numbers a body, in no unit: how those give way that the last Find could not hold. The fastest are those that nothing holds.
  const std::vector<double>& mechanism() const { return w_; }

 private:
  enum class Aim { kLeast, kCentre };
  void Weigh(Aim aim);
  bool Solve(const std::vector<double>& limits);
  void Take(double share);
  void DrawInside();
  bool FindCentre(const std::vector<double>& limits);
  double ShareInCones(double outside) const;
  void Multiply(const std::vector<double>& w, std::vector<double>* aw) const;
  double Miss(const std::vector<double>& limits);

  Problem* problem_ = nullptr;  // from Prepare on
  KktSystem system_;
  bool fresh_ = false;                            // the factor is that of start_
  std::vector<Vector3> start_, impulses_, step_;  // at hand; so far; what these change by next
  std::vector<Vector3> drift_;                    // the step without w
  std::vector<Matrix3> weights_;                  // D
  std::vector<double> missed_, wanted_, w_, residual_, correction_, image_;
};

}  // namespace islet::qp
