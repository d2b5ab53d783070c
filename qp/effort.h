// How much work one island may cost at most: what a solver has reached then is its answer, and it says how far that is. The same
// for every machine and number of threads.
#pragma once

#include <limits>

namespace islet::qp {

struct Effort {
  int sweeps = 0;         // visits of every contact
  int newton_bodies = 0;  // islands of no more bodies go on by Newton's method
};

inline constexpr Effort kQuickEffort{20, 32}, kNormalEffort{100, 32}, kThoroughEffort{3000, std::numeric_limits<int>::max()};

}  // namespace islet::qp
