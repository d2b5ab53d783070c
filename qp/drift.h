// Sweeps that wander: where contacts all but replace each other, as those of one pair of bodies do, impulse moves from one to the
// other by nearly the same amount each sweep, for thousands of sweeps, until one of them opens or slides. Groups of contacts that
// drift together are taken there in one step: along their last change, as far as its geometric series goes or until a contact's
// impulse reaches the border of its cone. Aitken's extrapolation, one factor a group.                               [Ait26]
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include <span>
#include <vector>

#include "qp/gauss_seidel.h"
#include "qp/problem.h"

namespace islet::qp {

class Drift {
 public:
  // Two plain sweeps of the problem that `sweeps` has prepared, and the step that they point to. impulses and velocities as in
  // GaussSeidel::Sweep. scales: 1 / W per contact; what changes by less than `least` [velocity] does not drift. False if
  // nothing does.
  bool Follow(const Problem& problem, std::span<const double> scales, double least, GaussSeidel* sweeps,
              std::vector<Vector3>* impulses, std::vector<double>* velocities);

 private:
  struct Group {                               // by its first body
    double before = 0, across = 0, after = 0;  // |d1|^2, d1 . d2, |d2|^2 of the changes from sweep to sweep
    double factor = 0;                         // of d2
  };

  void FindGroups(const Problem& problem, std::span<const double> scales, double least,
                  const std::vector<Vector3>& third);
  Group& GroupOf(const ContactTerm& contact);

  std::vector<Vector3> first_, second_;  // impulses before the two sweeps, and between them
  std::vector<int> roots_;               // per body
  std::vector<int> drifting_;            // contacts
  std::vector<Group> groups_;            // per body
};

}  // namespace islet::qp
