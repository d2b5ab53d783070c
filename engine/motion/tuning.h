// What several files of this room share.
#pragma once

#include <algorithm>

#include "engine/geometry/edge_contact.h"

namespace islet::motion {

inline constexpr int kMostHalvings = 6;  // of a step, and of a piece of a crowd
// Of a step, for each body of a group that moves: what is over that soon is none.
inline constexpr double kBrief = 1.0 / (1 << kMostHalvings);
inline constexpr int kPasses = 8;  // of the carrying problem in a piece
// [rad] by which bodies of a group that touch turn against each other in a piece, at most.
inline constexpr double kTouchingTurn = 0.052;
inline constexpr double kPushOut = 0.2;  // of an overlap: what a piece takes back, where friction and blows pay for it
inline constexpr double kFastest = 20;   // times the least v_ref: what a way out of an overlap, or a turn, may ask for
// Of a size: how exactly gaps of what touches meet their end; half of it: bodies have met.
inline constexpr double kTouching = 0.5 * kTouch;
// Of a size: bodies that are so deep in each other are no contact any more. No way of a piece goes through that, and the report tells it.
inline constexpr double kInside = 0.02;

// Of a step of a group of so many bodies that move: a tenth to half a second for three and more. One that needs as much alone is jammed.
inline int MostWork(int bodies) { return std::min(100000, 35000 * std::min(bodies, 3)); }

}  // namespace islet::motion
