// Where a body that something holds turns into a wall: a box that wobbles from edge to edge comes down on the next edge in the
// middle of a step. It goes there and no farther, and bounces in the next step; the rest of its way is lost, its velocities stay.
// Put out of the wall by a correction it would have the height for nothing: flat boxes wobbled for ever.
//
//   who       a body that does not fly, between walls that stand still and bodies that hardly move beside it
//   which     those that it does not touch yet, and from which it bounces (others take its speed, whenever they are met)
//   when      gaps close evenly over the step, to first order in dt
//   threads:  one caller at a time; allocates only while worlds grow
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"

namespace islet {

class Stops {
 public:
  // False if nobody can stop. tolerances: [m] per body. ways: [m] per body, of its farthest point over the step, or more.
  bool FindCandidates(std::span<const Contact> contacts, std::span<const double> tolerances,
                      std::span<const std::uint8_t> flies, std::span<const double> ways, std::span<const Body> bodies);

  // After FindCandidates. gaps: [m] per contact, after the whole step.
  void FindMoments(std::span<const Contact> contacts, std::span<const double> gaps, std::span<const double> tolerances);

  // The share of its step after which the body stops; 1: it does not.
  double share(int body) const { return stops_[body].share; }

 private:
  struct Stop {
    bool may = true, bounces = false;
    double share = 1;
  };
  std::vector<Stop> stops_;  // per body
};

}  // namespace islet
