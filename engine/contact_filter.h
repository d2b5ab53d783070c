// Which pairs of bodies may touch: their layers must agree, neither is a sensor, nobody has set them apart, and the user's callback
// does not object.
//   threads: const use from any thread, if the callback allows it
#pragma once

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "engine/body.h"
#include "engine/collision_callback.h"

namespace islet {

// Whether it touches every body that does so, too.
inline bool IsPlain(const Body& body) { return !body.sensor && body.layers != 0 && ~body.collides_with == 0; }

inline bool LayersAgree(const Body& a, const Body& b) {
  return (a.layers & b.collides_with) != 0 && (b.layers & a.collides_with) != 0;
}

// Pairs that were set apart one by one.
class PairsApart {
 public:
  bool Has(int a, int b) const {
    return !pairs_.empty() && std::binary_search(pairs_.begin(), pairs_.end(), std::pair<int, int>(std::minmax(a, b)));
  }
  void Set(int a, int b, bool apart) {
    const std::pair<int, int> pair = std::minmax(a, b);
    const auto place = std::lower_bound(pairs_.begin(), pairs_.end(), pair);
    const bool known = place != pairs_.end() && *place == pair;
    if (!apart && known) pairs_.erase(place);
    if (apart && !known) pairs_.insert(place, pair);
  }
  void Forget(int body) {
    std::erase_if(pairs_, [&](const auto& pair) { return pair.first == body || pair.second == body; });
  }
  bool empty() const { return pairs_.empty(); }
  std::vector<std::pair<int, int>>& pairs() { return pairs_; }

 private:
  std::vector<std::pair<int, int>> pairs_;  // ascending
};

class ContactFilter {
 public:
  explicit ContactFilter(const PairsApart* apart) : apart_(apart) {}  // which must outlive it
  void SetCallback(CollisionCallback callback) { callback_ = std::move(callback); }
  // As what the callback sees them, for all who ask within a step; empty: as who asks has them. They must outlive it.
  void SetFound(std::span<const Body> bodies) { found_ = bodies; }
  bool has_callback() const { return static_cast<bool>(callback_); }

  // Whether it allows all pairs of plain bodies, unasked.
  bool AllowsPlain() const { return !callback_ && apart_->empty(); }
  bool Allows(std::span<const Body> bodies, int a, int b) const {
    const Body &x = bodies[a], &y = bodies[b];
    if (!LayersAgree(x, y) || x.sensor || y.sensor || apart_->Has(a, b)) return false;
    if (!callback_) return true;
    const auto [first, second] = std::minmax(a, b);
    const std::span<const Body> seen = found_.empty() ? bodies : found_;
    return callback_(first, second, seen[first], seen[second]);
  }

 private:
  const PairsApart* apart_;
  CollisionCallback callback_;
  std::span<const Body> found_;
};

// The filter, and bodies to ask it of.
struct PairRule {
  const ContactFilter* filter;
  std::span<const Body> bodies;
  bool Allows(int a, int b) const { return filter->Allows(bodies, a, b); }
};

}  // namespace islet
