// Union-find on memory of the caller, with the smallest member of a set as its root.
//
//   in/out: one int per element, overwritten by the constructor; parents[x] is x for a root, else a smaller member
//   invariant: parents[x] <= x. A pass in ascending order therefore meets every parent before its children, which is
//   what lets BuildPartition turn the parents into island numbers in place.
//
// The smaller root always wins, so the balance of union by size is given up; path halving alone keeps a find at
// O(log n) amortised.
//   threads: one object per thread
#pragma once

#include <cassert>
#include <numeric>
#include <span>

namespace islet::islands {

class DisjointSets {
 public:
  // Every element in a set of its own.
  explicit DisjointSets(std::span<int> parents) : parents_(parents) { std::iota(parents.begin(), parents.end(), 0); }

  // The smallest member of the set that holds `element`.
  int Find(int element) {
    assert(0 <= element && element < static_cast<int>(parents_.size()));
    while (Parent(element) != element) {
      Parent(element) = Parent(Parent(element));
      element = Parent(element);
    }
    return element;
  }

  // Returns whether the two were in different sets until now.
  bool Union(int a, int b) {
    a = Find(a);
    b = Find(b);
    if (a == b) return false;
    if (a < b) {
      Parent(b) = a;
    } else {
      Parent(a) = b;
    }
    return true;
  }

 private:
  int& Parent(int element) { return parents_[static_cast<std::size_t>(element)]; }

  std::span<int> parents_;
};

}  // namespace islet::islands
