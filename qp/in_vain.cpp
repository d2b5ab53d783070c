#include "qp/in_vain.h"

#include <numeric>

namespace islet::qp {

int InVain::times() const { return std::accumulate(times_.begin(), times_.end(), 0); }
double InVain::seconds() const { return std::accumulate(seconds_.begin(), seconds_.end(), 0.0); }

void InVain::Add(Rung rung, double seconds, int times) {
  times_[Index(rung)] += times;
  seconds_[Index(rung)] += seconds;
}

void InVain::Include(const InVain& other) {
  for (std::size_t r = 0; r < times_.size(); ++r) {
    times_[r] += other.times_[r];
    seconds_[r] += other.seconds_[r];
  }
}

}  // namespace islet::qp
