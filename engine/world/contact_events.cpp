#include <algorithm>
#include <cmath>

#include "engine/world/world_impl.h"

namespace islet {
// What touches now against what touched then; both ascend, each pair once.
void World::Impl::FindEvents() {
  std::swap(events, events_before);
  std::erase_if(events_before, [](const ContactEvent& e) { return e.kind == ContactEventKind::kEnd; });
  FindSensed();
  events.clear();
  for (const Contact& c : touching) {
    if (events.empty() || !SamePair(events.back(), c)) events.push_back({ContactEventKind::kBegin, c.body_a, c.body_b});
  }
  for (const auto& [a, b] : sensed) events.push_back({ContactEventKind::kBegin, a, b, true});
  if (!sensed.empty()) std::sort(events.begin(), events.end(), EarlierPair);
  const size_t now = events.size();
  size_t next = 0;
  for (const ContactEvent& old : events_before) {
    while (next < now && EarlierPair(events[next], old)) ++next;
    if (next < now && SamePair(old, events[next])) {
      events[next].kind = ContactEventKind::kPersist;
    } else {
      events.push_back({ContactEventKind::kEnd, old.body_a, old.body_b, old.sensor});
    }
  }
  if (events.size() > now) std::sort(events.begin(), events.end(), EarlierPair);
}

// A step that does again what the one before did: what touches goes on.
void World::Impl::RepeatEvents() {
  hits.clear();
  std::erase_if(events, [](const ContactEvent& e) { return e.kind == ContactEventKind::kEnd; });
  for (ContactEvent& e : events) e.kind = ContactEventKind::kPersist;
}

// [m/s] at which the bodies of an impulse closed when they were like this, at the point where it acted.
double World::Impl::ApproachOf(const LedgerImpulse& j, std::span<const Body> then) const {
  const auto velocity = [&](int i) -> Vector3 {
    const Body& b = then[i].kind == BodyKind::kDynamic ? then[i] : before[i];  // a wall on an arc as fast as halfway
    return b.linear_velocity_W - 0.5 * dt_hint * b.arc_W +
           b.angular_velocity_W.cross(j.contact.point_W - ledger.CentreAt(j, i));
  };
  return j.contact.normal_W.dot(velocity(j.contact.body_a) - velocity(j.contact.body_b));
}

// What approached, as this part of the step began, faster than gravity and the user's forces make it in the whole, or got a blow of more than
// they give the lighter body in it: slower and weaker ones come with all that rests. Told is how it closed as the whole began.
void World::Impl::AddHits() {
  const auto pull = [&](const Body& b) { return b.kind == BodyKind::kDynamic ? b.force_W.norm() / b.mass : 0.0; };
  const auto mass = [](const Body& b) { return b.kind == BodyKind::kDynamic ? b.mass : INFINITY; };
  for (const LedgerImpulse& j : ledger_impulses) {
    if (j.corrects >= 0) continue;
    const int a = j.contact.body_a, b = j.contact.body_b;
    const double fall = whole_dt * (settings.gravity.norm() + std::max(pull(bodies[a]), pull(bodies[b])));
    const double approach = ApproachOf(j, before), pressed = j.contact.normal_W.dot(j.impulse_W);
    const bool blow = j.duration == 0 && pressed > std::min(mass(bodies[a]), mass(bodies[b])) * fall;
    if (blow || (approach > fall && pressed > 0))
      hits.push_back({a, b, j.contact.point_W, Vector3::Zero(), std::max(0.0, ApproachOf(j, found))});
  }
}

// Once a pair, told of its fastest point, with all that its points gave in the whole step.
void World::Impl::TellHits() {
  std::stable_sort(hits.begin(), hits.end(), [](const HitEvent& x, const HitEvent& y) {
    return EarlierPair(x, y) || (SamePair(x, y) && x.approach > y.approach);
  });
  hits.erase(std::unique(hits.begin(), hits.end(), SamePair), hits.end());
  for (size_t c = 0; c < resolved.size(); ++c) {
    const HitEvent pair{resolved[c].body_a, resolved[c].body_b};
    const auto hit = std::lower_bound(hits.begin(), hits.end(), pair, EarlierPair);
    if (hit != hits.end() && SamePair(*hit, pair)) hit->impulse_W += impulses[c];
  }
}

}  // namespace islet
