// Exact Coulomb friction by operator splitting: the alternating direction method of multipliers, with one linear system
// for all bodies and the exact law contact by contact.                                               [BPCPE11, ACB18]
//
//   unknowns per contact   w, the velocity that the law sees, and the impulse j; wanted: w = u(v) = J v + drift
//   bodies     (M + sum J^T D J) v = M v0 + sum J^T (j + D (w - drift))       one solve, the factors are kept
//   contacts   w + compliance j and j obey the law, w = u(v) + D^-1 (j - j_before)   closed form, as D is diagonal
//
// D, one number for the normal and one for both tangents of a contact, is what makes it fast: like the scaling of an
// interior point it is about j over u, large where a contact sticks, small where it opens. An iteration costs a
// fiftieth of an interior-point iteration on a big island and carries loads through the whole pile, which sweeps do
// not; on the way to ten digits it slows down.
//   threads: one caller at a time; loops fork over idle workers, same bits for any number; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/kkt.h"
#include "qp/problem.h"

namespace islet::qp {

class Splitting {
 public:
  enum class Metric {
    kUniform,  // in proportion to each contact's own inertia: nothing is known of the answer yet
    kAdapted,  // from the impulses and velocities at hand
  };

  // kkt: factorised here with one field; nobody else may use it until the last Run. Both must outlive the last Run.
  void Start(const Problem& problem, KktSystem* kkt);

  // Iterates from the given impulses and velocities (M (v - v0) = J^T j), which hold the same relation afterwards; the
  // impulses lie in their cones. One factorisation. doubt: [velocity] > 0, about the error of the velocities at hand; the
  // adapted metric trusts them no more than that. Too little doubt may lead astray, too much makes slow.
  void Run(int iterations, Metric metric, double doubt, std::vector<Vector3>* impulses, std::vector<double>* velocities);

 private:
  struct Place {  // a contact as a body sees it
    int contact;
    bool is_a;
  };
  struct Weight {
    double normal, tangent;  // of D
  };
  void ChooseMetric(Metric metric, double doubt, const std::vector<Vector3>& impulses);
  void SolveBodies(const std::vector<Vector3>& impulses);
  void SolveContacts(std::vector<Vector3>* impulses);

  const Problem* problem_ = nullptr;
  KktSystem* kkt_ = nullptr;
  std::vector<double> inertia_;      // per contact: 3 / tr W_cc
  std::vector<Weight> weights_;      // per contact
  std::vector<Matrix3> blocks_;      // D per contact, as kkt takes it
  std::vector<double> no_bounces_;   // kkt has one field
  std::vector<Vector3> velocities_;  // w per contact
  std::vector<Vector3> pulls_;       // j + D (w - drift) per contact
  std::vector<double> bodies_;       // right-hand side, then v
  std::vector<int> place_start_;     // per body, into places_
  std::vector<Place> places_;        // contacts of a body, ascending
};

}  // namespace islet::qp
