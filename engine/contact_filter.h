// Which pairs of bodies may touch: their layers must agree, neither is a sensor, and nobody has set them apart.
//   threads: const use from any thread
#pragma once

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "engine/body.h"

namespace islet {

inline bool LayersAgree(const Body& a, const Body& b) {
  return (a.layers & b.collides_with) != 0 && (b.layers & a.collides_with) != 0;
}

class ContactFilter {
 public:
  bool Allows(std::span<const Body> bodies, int a, int b) const {
    const Body &x = bodies[a], &y = bodies[b];
    return LayersAgree(x, y) && !x.sensor && !y.sensor && !SetApart(a, b);
  }
  bool SetApart(int a, int b) const {
    return !apart_.empty() && std::binary_search(apart_.begin(), apart_.end(), std::pair<int, int>(std::minmax(a, b)));
  }
  void Set(int a, int b, bool collide) {
    const std::pair<int, int> pair = std::minmax(a, b);
    const auto place = std::lower_bound(apart_.begin(), apart_.end(), pair);
    const bool known = place != apart_.end() && *place == pair;
    if (collide && known) apart_.erase(place);
    if (!collide && !known) apart_.insert(place, pair);
  }
  std::vector<std::pair<int, int>>& apart() { return apart_; }
  void Forget(int body) {
    std::erase_if(apart_, [&](const auto& pair) { return pair.first == body || pair.second == body; });
  }

 private:
  std::vector<std::pair<int, int>> apart_;  // ascending
};

}  // namespace islet
