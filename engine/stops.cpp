#include "engine/stops.h"

#include <algorithm>

#include "engine/suite_frame.h"

namespace islet {
namespace {

// [m] gaps this close to nothing are touches, and overlaps that nobody corrects.
double Slight(const Contact& c, std::span<const double> tolerances) {
  return 0.5 * std::min(tolerances[c.body_a], tolerances[c.body_b]);
}

bool Bounces(const Contact& contact, std::span<const double> tolerances) {
  return contact.restitution > 0 && contact.gap > Slight(contact, tolerances);
}

}  // namespace

bool Stops::FindCandidates(std::span<const Contact> contacts, std::span<const double> tolerances,
                           std::span<const std::uint8_t> flies, std::span<const Body> bodies) {
  stops_.assign(bodies.size(), {});
  for (const Contact& contact : contacts) {
    const bool moves_a = bodies[contact.body_a].Moves(), moves_b = bodies[contact.body_b].Moves();
    Stop &a = stops_[contact.body_a], &b = stops_[contact.body_b];
    if (moves_a && moves_b) {
      a.alone = b.alone = false;
    } else {
      Stop& stop = moves_a ? a : b;
      stop.alone = stop.alone && StandsStill(bodies[moves_a ? contact.body_b : contact.body_a]);
      stop.bounces = stop.bounces || Bounces(contact, tolerances);
    }
  }
  bool any = false;
  for (size_t i = 0; i < bodies.size(); ++i) {
    stops_[i].alone = stops_[i].alone && stops_[i].bounces && bodies[i].Moves() && !flies[i];
    any = any || stops_[i].alone;
  }
  return any;
}

void Stops::FindMoments(std::span<const Contact> contacts, std::span<const double> gaps,
                        std::span<const double> tolerances, std::span<const Body> bodies) {
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Contact& contact = contacts[c];
    Stop& stop = stops_[bodies[contact.body_a].Moves() ? contact.body_a : contact.body_b];
    if (!stop.alone || !Bounces(contact, tolerances) || gaps[c] >= -Slight(contact, tolerances)) continue;
    const double share = contact.gap / (contact.gap - gaps[c]);
    if (share < stop.share) stop.share = share, stop.contact = static_cast<int>(c);
  }
}

}  // namespace islet
