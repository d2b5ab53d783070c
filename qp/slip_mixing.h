// Anderson's acceleration of lagged slips: a convex problem is given slips, its answer has others, and where the two agree exact
// Coulomb friction is met. From the last few pairs the next slips are chosen by least squares, as if answers were linear in
// what they were given. Slips that settle by a factor of two to seven in a plain round need a third of the rounds.  [And65]
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace islet::qp {

class SlipMixing {
 public:
  // Forgets all pairs; from now on there are so many slips.
  void Begin(std::size_t size);

  // Takes note that a problem with slips `given` has an answer with slips `found`.
  void Add(const std::vector<double>& given, const std::vector<double>& found);

  // Slips for the next problem, from the pairs added. They are not negative.
  void Next(std::vector<double>* slips);

 private:
  static constexpr int kDepth = 3;  // of 3, 5 and 10 the best on towers that slide
  struct Change {                   // from one pair to the next
    std::vector<double> found, miss;
  };
  int pairs_ = 0;
  std::vector<double> found_, miss_, left_;  // miss: found - given
  std::array<Change, kDepth> changes_;       // the last one at (pairs_ - 2) % kDepth
  std::array<Change, kDepth> mixed_;         // the same, misses orthogonal
};

}  // namespace islet::qp
