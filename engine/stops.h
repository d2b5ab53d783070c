// Where a body that something holds turns into a wall: a box that wobbles from edge to edge comes down on the next edge in the
// middle of a step. It stops there, at that moment and with the velocity of that moment, as flying bodies do (flight.h), and
// bounces in the next step; what is left of the step is lost. Put out of the wall by a correction it would have the height for
// nothing: flat boxes wobbled for ever.
//
//   who       a body with no other one near, all of whose walls stand still, and that does not fly
//   which     walls that it does not touch yet, and from which it bounces (others take its speed, whenever they are met)
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
  // False if nobody can stop. tolerances: [m] per body.
  bool FindCandidates(std::span<const Contact> contacts, std::span<const double> tolerances,
                      std::span<const std::uint8_t> flies, std::span<const Body> bodies);

  // After FindCandidates. gaps: [m] per contact, after the whole step.
  void FindMoments(std::span<const Contact> contacts, std::span<const double> gaps, std::span<const double> tolerances,
                   std::span<const Body> bodies);

  // The contact at which the body stops, or -1; and after which share of its step.
  int contact(int body) const { return stops_[body].contact; }
  double share(int body) const { return stops_[body].share; }

 private:
  struct Stop {
    bool alone = true, bounces = false;
    double share = 1;
    int contact = -1;
  };
  std::vector<Stop> stops_;  // per body
};

}  // namespace islet
