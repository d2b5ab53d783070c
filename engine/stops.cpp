#include "engine/stops.h"

#include <algorithm>

#include "engine/suite_frame.h"

namespace islet {
namespace {

constexpr double kStill = 0.05;  // of a body's way: others that go no farther count as walls

// [m] gaps this close to nothing are touches, and overlaps that nobody corrects.
double Slight(const Contact& c, std::span<const double> tolerances) {
  return 0.5 * std::min(tolerances[c.body_a], tolerances[c.body_b]);
}

bool Bounces(const Contact& contact, std::span<const double> tolerances) {
  return contact.restitution > 0 && contact.gap > Slight(contact, tolerances);
}

}  // namespace

bool Stops::FindCandidates(std::span<const Contact> contacts, std::span<const double> tolerances,
                           std::span<const std::uint8_t> flies, std::span<const double> ways,
                           std::span<const Body> bodies) {
  stops_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) stops_[i] = {.may = bodies[i].Moves() && !flies[i]};
  for (const Contact& contact : contacts) {
    const bool bounces = Bounces(contact, tolerances);
    const auto meets = [&](int body, int other) {
      Stop& stop = stops_[body];
      const bool still = bodies[other].Moves() ? ways[other] <= kStill * ways[body] : StandsStill(bodies[other]);
      stop.may = stop.may && still;
      stop.bounces = stop.bounces || bounces;
    };
    meets(contact.body_a, contact.body_b);
    meets(contact.body_b, contact.body_a);
  }
  bool any = false;
  for (Stop& stop : stops_) {
    stop.may = stop.may && stop.bounces;
    any = any || stop.may;
  }
  return any;
}

void Stops::FindMoments(std::span<const Contact> contacts, std::span<const double> gaps,
                        std::span<const double> tolerances) {
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Contact& contact = contacts[c];
    if (!Bounces(contact, tolerances) || gaps[c] >= -Slight(contact, tolerances)) continue;
    const double share = contact.gap / (contact.gap - gaps[c]);
    for (const int body : {contact.body_a, contact.body_b})
      if (stops_[body].may) stops_[body].share = std::min(stops_[body].share, share);
  }
}

}  // namespace islet
