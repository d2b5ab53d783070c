// Contacts that a face does not need: between the same two bodies, points inside the hull of others with the same normal.
//
//   left out   a contact whose Jacobians and drift are convex combinations of up to three others' of its pair of bodies, with
//              the same friction and a target that the combination meets; a duplicate is its twin's, times one
//   exact      for every model: u is linear in the Jacobians and drifts and the dual cones are convex, so where the corners
//              hold to the law, u of such a contact lies in its dual cone, and with j = 0 it does, too. For the convex models
//              nothing is lost either: an impulse inside the hull is the sum of impulses at the corners in the same
//              directions. For exact Coulomb friction the answers with impulses inside the hull are left out: a
//              face that turns while it slides rubs at its corners alone
//
// Only contacts that follow each other in the problem's order are compared, as those of a pair of bodies do.
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include <array>
#include <span>
#include <vector>

#include "qp/problem.h"
#include "qp/solution.h"

namespace islet::qp {

class ContactReduction {
 public:
  // False if every contact is needed.
  bool Reduce(const Problem& problem);

  const Problem& problem() const { return reduced_; }

  // The impulses of the contacts that are left.
  void Select(std::span<const Vector3> whole, std::vector<Vector3>* kept) const;

  // The answer of the whole problem: nothing at the contacts that were left out, their slips as their corners'.
  void Expand(const Solution& reduced, Solution* solution) const;

 private:
  struct Point {
    double x, y;  // lever arm of the normal, along two axes across it
    int contact;
  };
  // Of up to three corners.
  struct Combination {
    std::array<int, 3> corners{-1, -1, -1};
    std::array<double, 3> weights{};
  };

  void ReduceFace(const Problem& problem, int first, int last);
  void FindHull();
  bool Combine(const Problem& problem, const Point& point, Combination* combination) const;

  Problem reduced_;
  std::vector<int> place_;                 // per contact: in reduced_, or -1
  std::vector<Combination> combinations_;  // per contact
  std::vector<Point> points_, hull_;       // scratch
};

}  // namespace islet::qp
