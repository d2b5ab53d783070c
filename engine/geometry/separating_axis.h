// Which of the axes that a pair of polytopes offers carries the contact. Shared by boxes and hulls.
//
// An axis n (unit, from a to b) has a separation s(n): the gap between the two bodies' extents along it, negative if
// they overlap. Bodies that overlap along every axis leave by the one of least depth. Bodies that some axis separates
// stay apart as long as any one does, so among those the best is the one that separates them most.
#pragma once

#include <algorithm>

#include "engine/linear_algebra.h"

namespace islet {

// Among axes whose scores differ by less than this the earlier one is kept, so that round-off does not make the contact
// jump between features: first the faces of a, of boxes those of the larger one, then those of the other, then the edge pairs.
inline double FaceSlack(double size) { return 1e-6 * size; }  // size: [m] smallest extent of the pair
inline double EdgeSlack(double size) { return 1e-4 * size; }

// Overlaps and gaps up to this are what a body at rest may have.
inline double TouchSlack(double size) { return 1e-3 * size; }

struct AxisScore {
  bool separates = false;
  double separation = -1e300;  // [m]

  // An overlap up to the touch slack still counts as apart: two cubes that slide along each other's sides with a
  // little overlap must not be caught by each other's tops.
  static AxisScore Of(double separation, double size) { return {separation > -TouchSlack(size), separation}; }
  bool BetterThan(const AxisScore& other, double slack) const {
    if (separates != other.separates) return separates;
    return separation > other.separation + slack;
  }
  // [m] separation that an axis must exceed to be better than this one.
  double Needed(double slack, double size) const {
    return separates ? separation + slack : std::min(separation + slack, -TouchSlack(size));
  }
};

}  // namespace islet
