// One body that several contacts hold against immovable things: a brick on a face, on an edge, between two walls.
//
//   answers   where every contact either reaches its target velocity (u = b n: it sticks, or bounces straight off) or does not
//             press. There models and cones do not differ, since no slip is left
//   velocity  among those with u = b n at the pressing contacts the nearest to v0 in the mass metric, by orthogonal rows:
//             contacts may be redundant, and may leave freedom (on an edge a body still turns)
//   impulses  the shortest in the friction cones that give this velocity: Newton's method on the dual, six unknowns. Two
//             equal bodies in equal places get equal impulses, whatever was before
//   refused   what slides, tips or is asked for two velocities at once; compliance; bounces of the kinetic model
//
//   threads: one caller at a time; never allocates
#pragma once

#include <array>

#include "qp/problem.h"
#include "qp/settings.h"
#include "qp/solution.h"

namespace islet::qp {

class OneBody {
 public:
  static constexpr int kMostContacts = 128;

  // Whether the island is of this kind at all.
  static bool Fits(const Problem& problem);

  // For a problem that fits. solution: velocities are v0, impulses and slips zero, one a contact; so they stay if it refuses.
  bool Solve(const Problem& problem, const Settings& settings, Solution* solution);

 private:
  bool Read(const Problem& problem, const Settings& settings);
  bool FindMotion();
  bool FindImpulses();
  double Dual(const Vector6& y);
  bool Holds(const Problem& problem, const Settings& settings, Solution* solution) const;

  struct Row {
    Vector6 row;
    double wanted;
  };

  int contacts_ = 0;
  double limit_ = 0, gap_limit_ = 0;  // [m/s] what a contact may miss its target by, what the gap asks for
  // In coordinates w of the body in which v = v0 + M^-1/2 w, so that what v costs is |w|.
  std::array<Jacobian, kMostContacts> jacobians_;
  std::array<Vector3, kMostContacts> missing_;  // b n - u before any impulse
  std::array<double, kMostContacts> friction_;
  std::array<bool, kMostContacts> presses_;
  std::array<Row, 3 * kMostContacts> rows_;
  std::array<Vector3, kMostContacts> impulses_;
  Vector6 motion_;    // w
  double reach_ = 0;  // longest row: velocity at a contact for a unit of w
};

}  // namespace islet::qp
