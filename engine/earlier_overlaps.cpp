#include "engine/earlier_overlaps.h"

#include <algorithm>

namespace islet {
namespace {

Vector3 ToBody(const Body& body, const Vector3& point_W) {
  return body.rotation_WB.conjugate() * (point_W - body.position_W);
}

Vector3 ToWorld(const Body& body, const Vector3& point_B) { return body.position_W + body.rotation_WB * point_B; }

// Found again, and open; or found from the other side.
bool IsOver(const Contact& kept, std::span<const Contact> contacts) {
  const auto [first, last] = std::equal_range(contacts.begin(), contacts.end(), kept, EarlierPair);
  return std::any_of(first, last, [&](const Contact& c) {
    return (c.feature == kept.feature && c.gap >= 0) || c.normal_W.dot(kept.normal_W) < 0;
  });
}

}  // namespace

void EarlierOverlaps::Keep(std::span<const Contact> contacts, std::span<const double> tolerances,
                           std::span<const Body> bodies) {
  for (const Contact& c : contacts) {
    if (-c.gap <= std::min(tolerances[c.body_a], tolerances[c.body_b])) continue;
    const Vector3 half = 0.5 * c.gap * c.normal_W;  // the point lies midway
    const Kept now{c, ToBody(bodies[c.body_a], c.point_W - half), ToBody(bodies[c.body_b], c.point_W + half)};
    const auto at = std::lower_bound(kept_.begin(), kept_.end(), c, [](const Kept& kept, const Contact& contact) {
      return Earlier(kept.contact, contact);
    });
    if (at != kept_.end() && !Earlier(c, at->contact)) {
      *at = now;
    } else {
      kept_.insert(at, now);
    }
  }
}

const std::vector<Contact>& EarlierOverlaps::With(std::span<const Contact> contacts, std::span<const Body> bodies) {
  std::erase_if(kept_, [&](const Kept& kept) { return IsOver(kept.contact, contacts); });
  with_.assign(contacts.begin(), contacts.end());
  for (const Kept& kept : kept_) {
    if (std::binary_search(contacts.begin(), contacts.end(), kept.contact, Earlier)) continue;
    const Vector3 on_a = ToWorld(bodies[kept.contact.body_a], kept.on_a_B);
    const Vector3 on_b = ToWorld(bodies[kept.contact.body_b], kept.on_b_B);
    with_.push_back(kept.contact);
    with_.back().point_W = 0.5 * (on_a + on_b);
    with_.back().gap = std::max(kept.contact.gap, kept.contact.normal_W.dot(on_b - on_a));
  }
  return with_;
}

}  // namespace islet
