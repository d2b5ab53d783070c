// How much work one island may cost at most: what a solver has reached then is its answer, and it says how far that is. The same
// for every machine and number of threads.
#pragma once

namespace islet::qp {

struct Effort {
  int sweeps = 0;       // visits of every contact, on islands of more than 32 bodies (in a crowd 8) that are no towers
  bool newton = false;  // these islands go on by Newton's method; smaller ones always do

  friend bool operator==(const Effort& x, const Effort& y) { return x.sweeps == y.sweeps && x.newton == y.newton; }
};

inline constexpr Effort kQuickEffort{20, false},  // games, first looks
    kNormalEffort{100, false},                    // the default
    kThoroughEffort{3000, true};                  // forces that are to be trusted

}  // namespace islet::qp
