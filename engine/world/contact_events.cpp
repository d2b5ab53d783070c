#include <algorithm>
#include <cmath>
#include <tuple>

#include "engine/world/world_impl.h"

namespace islet {
namespace {

bool Before(const ContactEvent& x, const ContactEvent& y) {
  return std::tie(x.body_a, x.body_b) < std::tie(y.body_a, y.body_b);
}

}  // namespace

// What touches now against what touched then; both ascend, each pair once.
void World::Impl::FindEvents() {
  std::swap(events, events_before);
  std::erase_if(events_before, [](const ContactEvent& e) { return e.kind == ContactEventKind::kEnd; });
  FindSensed();
  events.clear();
  for (const Contact& c : touching) {
    if (events.empty() || events.back().body_a != c.body_a || events.back().body_b != c.body_b)
      events.push_back({ContactEventKind::kBegin, c.body_a, c.body_b});
  }
  for (const auto& [a, b] : sensed) events.push_back({ContactEventKind::kBegin, a, b, true});
  if (!sensed.empty()) std::sort(events.begin(), events.end(), Before);
  const size_t now = events.size();
  size_t next = 0;
  for (const ContactEvent& old : events_before) {
    while (next < now && Before(events[next], old)) ++next;
    if (next < now && !Before(old, events[next])) {
      events[next].kind = ContactEventKind::kPersist;
    } else {
      events.push_back({ContactEventKind::kEnd, old.body_a, old.body_b, old.sensor});
    }
  }
  if (events.size() > now) std::sort(events.begin(), events.end(), Before);
}

// A step that does again what the one before did: what touches goes on.
void World::Impl::RepeatEvents() {
  hits.clear();
  std::erase_if(events, [](const ContactEvent& e) { return e.kind == ContactEventKind::kEnd; });
  for (ContactEvent& e : events) e.kind = ContactEventKind::kPersist;
}

// What approached faster than gravity makes anything in the step, or got a blow of more than the lighter body's weight in it: slower and
// weaker ones come with all that rests.
void World::Impl::AddHits(double dt) {
  const size_t begin = hits.size();
  const double fall = settings.gravity.norm() * dt;
  const auto mass = [](const Body& b) { return b.kind == BodyKind::kDynamic ? b.mass : INFINITY; };
  for (const LedgerImpulse& j : ledger_impulses) {
    const int a = j.contact.body_a, b = j.contact.body_b;
    const double approach = -NormalVelocity(j.contact, before[a], before[b]),
                 pressed = j.contact.normal_W.dot(j.impulse_W);
    const bool blow = j.duration == 0 && j.corrects < 0 && pressed > std::min(mass(bodies[a]), mass(bodies[b])) * fall;
    if (blow || (approach > fall && !j.impulse_W.isZero(0)))
      hits.push_back({a, b, j.contact.point_W, j.impulse_W, std::max(0.0, approach)});
  }
  const auto part = hits.begin() + static_cast<std::ptrdiff_t>(begin);
  std::stable_sort(part, hits.end(), [](const HitEvent& x, const HitEvent& y) {
    return std::tie(x.body_a, x.body_b) < std::tie(y.body_a, y.body_b);
  });
  auto end = part;
  for (auto hit = part; hit != hits.end(); ++hit) {
    if (end != part && (end - 1)->body_a == hit->body_a && (end - 1)->body_b == hit->body_b) {
      (end - 1)->impulse_W += hit->impulse_W;
      if (hit->approach > (end - 1)->approach) (end - 1)->approach = hit->approach, (end - 1)->point_W = hit->point_W;
    } else {
      *end++ = *hit;
    }
  }
  hits.erase(end, hits.end());
}

}  // namespace islet
