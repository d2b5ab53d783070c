// What is too small to matter, in qp and engine, and how long it is looked for. Each size is relative to what it is compared with, and named
// by its reason.
#pragma once

#include <limits>

namespace islet {

inline constexpr double kUlp = 4 * std::numeric_limits<double>::epsilon();  // rounding of a number or two
inline constexpr double kRounding = 1e-14;                                  // rounding of some dozen operations
inline constexpr double kExact = 1e-12;  // the same after a solve: what differs by less is equal
inline constexpr double kRefined =
    1e-11;  // what a formula or a refined solve may miss, and a mass that only keeps a factor regular
inline constexpr double kNegligible = 1e-9;  // lost beside any tolerance that a user may ask for
inline constexpr double kSamePoint =
    1e-6;  // of a size, or of unit length: points that are closer are one, and a user's rounding is forgiven
inline constexpr int kHalvings = 60;  // of an interval, which leave nothing of it in double precision
inline constexpr int kPatience = 20;  // steps of a method that better nothing, before it ends

}  // namespace islet
