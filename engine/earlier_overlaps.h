// Overlaps that were found after one pass of the motion, for all passes that follow. Where two edges of a pair lie all but parallel
// the detection names now this one and now that one: each pass opened one and closed the other, until the passes were used up.
//
//   keep   contacts that overlap, by the points of the two bodies that met
//   with   the contacts at hand, then those kept, as they are now: gap along the normal of then between the same two points, no
//          deeper than it was found. What is found again and open, or from the other side, is kept no longer
//   threads: one caller; allocates only while problems grow
#pragma once

#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"

namespace islet {

class EarlierOverlaps {
 public:
  void Clear() { kept_.clear(); }

  // tolerances: [m] per body; a pair's is the smaller one, and what overlaps by more is kept.
  void Keep(std::span<const Contact> contacts, std::span<const double> tolerances, std::span<const Body> bodies);

  // Without those that are among the contacts by themselves. Valid until the next call.
  const std::vector<Contact>& With(std::span<const Contact> contacts, std::span<const Body> bodies);

 private:
  struct Kept {
    Contact contact;
    Vector3 on_a_B, on_b_B;  // [m] the points that met, in the bodies' frames
  };
  std::vector<Kept> kept_;
  std::vector<Contact> with_;
};

}  // namespace islet
