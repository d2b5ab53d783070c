// What corrections of positions owe. They put bodies elsewhere while the velocities stay: a body that they lift has height that
// nobody paid for, and one that they push aside in flight another angular momentum. Here both are settled, pass by pass:
//
//   angular momentum   an island that touches no wall turns as a whole by what it was off
//   energy             the impulses that corrected act on the velocities too, scaled so that the energy is what it was. That is
//                      what happened: the bodies met before the step's end and went on slower. Momentum is kept, and what acts on
//                      walls is known. What does not approach pays nothing: impulses never push it.
//                      What they cannot pay of a turn, bodies that touch no wall pay by moving less beside each other.
//
//   in:  an island at its poses after the pass, what the pass shifted, the pushes that did it     out: velocities, scale
//   threads: islands in parallel, each by one thread; frozen bodies get their share afterwards
#pragma once

#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"

namespace islet {

// One contact of an island: where it is now, and with what it corrected.
struct Push {
  int contact = -1;  // in the list of the pass
  int body_a = -1, body_b = -1;
  Vector3 point_W = Vector3::Zero();  // [m] where the material points that met are now
  Vector3 push_W = Vector3::Zero();   // [kg m] on body_b
};

// Of one body in one pass: what its correction changed.
struct Shift {
  Vector3 linear = Vector3::Zero();  // [m]
  Vector3 spin = Vector3::Zero();    // [N m s] of its angular momentum about its centre
};

class CorrectionBalance {
 public:
  // Settles one island. shifts: per body of the world. free: no wall is near. Returns by how much the pushes act on the
  // velocities [1/s]; 0: not.
  double Settle(const Vector3& gravity_W, std::span<const int> members, std::span<const Push> pushes,
                std::span<const Shift> shifts, bool free, std::span<Body> bodies);

 private:
  struct Kick {
    Vector3 linear, angular;  // [m, rad] what the pushes do to a body
  };
  static double TurnBack(std::span<const int> members, std::span<const Shift> shifts, std::span<Body> bodies);
  std::vector<Kick> kicks_;  // per member
};

}  // namespace islet
