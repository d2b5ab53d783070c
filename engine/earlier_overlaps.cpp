#include "engine/earlier_overlaps.h"

#include <algorithm>
#include <tuple>

namespace islet {
namespace {

Vector3 ToBody(const Body& body, const Vector3& point_W) {
  return body.rotation_WB.conjugate() * (point_W - body.position_W);
}

Vector3 ToWorld(const Body& body, const Vector3& point_B) { return body.position_W + body.rotation_WB * point_B; }

bool Earlier(const Contact& x, const Contact& y) {
  return std::tie(x.body_a, x.body_b, x.feature) < std::tie(y.body_a, y.body_b, y.feature);
}

}  // namespace

void EarlierOverlaps::Keep(std::span<const Contact> contacts, std::span<const double> tolerances,
                           std::span<const Body> bodies) {
  for (const Contact& c : contacts) {
    if (-c.gap <= std::min(tolerances[c.body_a], tolerances[c.body_b])) continue;
    const Vector3 half = 0.5 * c.gap * c.normal_W;  // the point lies midway
    const Kept now{c, ToBody(bodies[c.body_a], c.point_W - half), ToBody(bodies[c.body_b], c.point_W + half)};
    const auto same = [&](const Kept& kept) { return !Earlier(kept.contact, c) && !Earlier(c, kept.contact); };
    const auto before = std::find_if(kept_.begin(), kept_.end(), same);
    if (before == kept_.end()) {
      kept_.push_back(now);
    } else {
      *before = now;
    }
  }
}

const std::vector<Contact>& EarlierOverlaps::With(std::span<const Contact> contacts, std::span<const Body> bodies) {
  with_.assign(contacts.begin(), contacts.end());
  for (const Kept& kept : kept_) {
    if (std::binary_search(contacts.begin(), contacts.end(), kept.contact, Earlier)) continue;
    const Vector3 on_a = ToWorld(bodies[kept.contact.body_a], kept.on_a_B);
    const Vector3 on_b = ToWorld(bodies[kept.contact.body_b], kept.on_b_B);
    with_.push_back(kept.contact);
    with_.back().point_W = 0.5 * (on_a + on_b);
    with_.back().gap = kept.contact.normal_W.dot(on_b - on_a);
  }
  return with_;
}

}  // namespace islet
