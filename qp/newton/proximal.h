// What the proximal methods of exact friction share: the law of a contact on a spring, and how stiff the springs are.   [Roc76, AC91]
//
//   one step, from impulses j':  j = L(j' - t (u - b n)),  L: CutToCone of slip.h
//
// Repeated, the springs relax, and where impulses stay what they were, they are exact. t decides about nothing but the pace.
//   threads: pure functions; one pace per solve
#pragma once

#include "qp/natural_map.h"
#include "qp/problem.h"

namespace islet::qp {

// Of Newton's method inside a step: a shorter way where the residual does not fall by this share of what the slope promises.
inline constexpr int kSearchHalvings = 8;
inline constexpr double kLeastDescent = 1e-4;

// Of CutToCone, an element of the generalised derivative. The first column below the diagonal is what a normal pull does to friction.
// rests: [of a pull] below it a contact neither presses nor parts. It is taken to press: rounding would choose, and what is symmetric would turn to
// one side.
Matrix3 SpringSlope(Vector3 pull, double friction, double rests = 0);

// Steps that gained and were short make the springs stiffer, those that failed softer: what they may be then grows as fast again. They are
// never so stiff that what rounding leaves of velocities is a force that matters.
class ProximalPace {
 public:
  static constexpr int kMostNewtonSteps = 12;  // of one proximal step

  explicit ProximalPace(const NaturalMap& start) : best_(start.rms), halved_(start.rms) {}

  // Of the next step, which is solved to `residual` among velocities of this size; speed 0: whatever rounding does.
  double Stiffness(double residual, double speed);
  // Whether the impulses of a step are the centre of the next one. map: theirs [rms], newton_steps: what it took, solved: whether it
  // was; refines: what was met is enough, and only halving it is a gain.
  bool Takes(double map, bool solved, int newton_steps, bool refines);
  // Whether another step may gain something.
  bool GoesOn(bool refines) const;

 private:
  static constexpr double kFirst = 30, kLeast = 1e-3, kMost = 1e6;

  double stiffness_ = kFirst, limit_ = kMost;
  double best_, halved_;  // natural maps: the least, and that of the last step that was a gain
  int stalled_ = 0;       // steps since then
};

}  // namespace islet::qp
