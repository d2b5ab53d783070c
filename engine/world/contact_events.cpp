#include <algorithm>
#include <cmath>
#include <tuple>

#include "engine/world/world_impl.h"

namespace islet {
namespace {

constexpr double kOnBody = 1e-3;  // of a radius: how far outside of it a point may lie and be the body's

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

// [m/s] at which the bodies of an impulse closed as the step began, at the point where it acted. Where that point was on a body: as if it had
// flown freely until then, or else evenly from where it was to where it is.
double World::Impl::ApproachOf(const LedgerImpulse& j, double dt) const {
  const double when = j.time + 0.5 * j.duration;
  const auto velocity = [&](int i) -> Vector3 {
    const Body& b = before[i];
    const Vector3 free = b.position_W + when * b.linear_velocity_W;
    const Vector3 even = b.position_W + when / dt * (bodies[i].position_W - b.position_W);
    for (const Vector3& centre : {free, even}) {
      const Vector3 lever = j.contact.point_W - centre;
      if (lever.norm() <= (1 + kOnBody) * b.radius) return b.linear_velocity_W + b.angular_velocity_W.cross(lever);
    }
    return b.linear_velocity_W;
  };
  return j.contact.normal_W.dot(velocity(j.contact.body_a) - velocity(j.contact.body_b));
}

// What approached faster than gravity makes anything in the step, or got a blow of more than the lighter body's weight in it: slower and
// weaker ones come with all that rests.
void World::Impl::AddHits(double dt) {
  const size_t begin = hits.size();
  const double fall = settings.gravity.norm() * dt;
  const auto mass = [](const Body& b) { return b.kind == BodyKind::kDynamic ? b.mass : INFINITY; };
  const auto earlier = [](const HitEvent& x, const HitEvent& y) {
    return std::tie(x.body_a, x.body_b) < std::tie(y.body_a, y.body_b);
  };
  for (const LedgerImpulse& j : ledger_impulses) {
    if (j.corrects >= 0) continue;
    const int a = j.contact.body_a, b = j.contact.body_b;
    const double approach = ApproachOf(j, dt), pressed = j.contact.normal_W.dot(j.impulse_W);
    const bool blow = j.duration == 0 && pressed > std::min(mass(bodies[a]), mass(bodies[b])) * fall;
    if (blow || (approach > fall && pressed > 0))
      hits.push_back({a, b, j.contact.point_W, Vector3::Zero(), std::max(0.0, approach)});
  }
  // Once a pair, told of its fastest point, with all that its points gave.
  const auto part = hits.begin() + static_cast<std::ptrdiff_t>(begin);
  std::stable_sort(part, hits.end(), [&](const HitEvent& x, const HitEvent& y) {
    return earlier(x, y) || (!earlier(y, x) && x.approach > y.approach);
  });
  const auto same = [&](const HitEvent& x, const HitEvent& y) { return !earlier(x, y) && !earlier(y, x); };
  hits.erase(std::unique(part, hits.end(), same), hits.end());
  for (const LedgerImpulse& j : ledger_impulses) {
    const HitEvent pair{j.contact.body_a, j.contact.body_b};
    const auto hit = std::lower_bound(hits.begin() + static_cast<std::ptrdiff_t>(begin), hits.end(), pair, earlier);
    if (hit != hits.end() && same(*hit, pair)) hit->impulse_W += j.impulse_W;
  }
}

}  // namespace islet
