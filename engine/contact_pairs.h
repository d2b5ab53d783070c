// Lists of contacts pair by pair: two lists side by side, each in the order of EarlierPair.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "engine/contact.h"

namespace islet {

// [m] of the contacts of a pair; infinite if there are none.
inline double LeastGap(std::span<const Contact> of_pair) {
  double gap = INFINITY;
  for (const Contact& c : of_pair) gap = std::min(gap, c.gap);
  return gap;
}

// Calls f(first and last place in x, the same in y) for each pair of bodies that has contacts in x, in y or in both.
template <typename F>
void ForEachPair(std::span<const Contact> x, std::span<const Contact> y, const F& f) {
  for (size_t i = 0, k = 0; i < x.size() || k < y.size();) {
    const bool from_y = i == x.size() || (k < y.size() && EarlierPair(y[k], x[i]));
    const Contact& pair = from_y ? y[k] : x[i];
    const size_t first_i = i, first_k = k;
    while (i < x.size() && SamePair(x[i], pair)) ++i;
    while (k < y.size() && SamePair(y[k], pair)) ++k;
    f(first_i, i, first_k, k);
  }
}

// Where the contacts of one pair are in two lists: first and last place in x, the same in y.
struct PairPlaces {
  size_t x, x_end, y, y_end;
};

inline void ListPairs(std::span<const Contact> x, std::span<const Contact> y, std::vector<PairPlaces>* pairs) {
  pairs->clear();
  ForEachPair(x, y, [pairs](size_t i, size_t i_end, size_t k, size_t k_end) {
    pairs->push_back({i, i_end, k, k_end});
  });
}

}  // namespace islet
