#include "engine/freezing/paper_freezing.h"

#include <algorithm>
#include <cstdint>

#include "islands/freezing.h"

namespace islet {

void FreezeLikePaper(const SuiteFrame& frame, const Settings& settings, std::vector<int>* counters) {
  const size_t n = frame.bodies.size();
  std::vector<double> energy(n), threshold(n);
  std::vector<std::uint8_t> touches(n, 0), may(n, 0), frozen(n, 0);
  for (size_t i = 0; i < n; ++i) {
    const Body& body = frame.bodies[i];
    energy[i] = body.KineticEnergy();
    threshold[i] = 0.5 * body.mass * frame.rest_speed * frame.rest_speed;
    frozen[i] = body.frozen;
    const auto inside = [&](const Region& r) {
      return (body.position_W.array() >= r.lower.array()).all() && (body.position_W.array() <= r.upper.array()).all();
    };
    may[i] = body.Moves() && (settings.cold_volumes.empty() ||
                              std::any_of(settings.cold_volumes.begin(), settings.cold_volumes.end(), inside));
  }
  for (const Contact& c : frame.contacts.contacts) {
    const auto stands = [&](int i) { return frozen[i] || frame.bodies[i].kind == BodyKind::kFixed; };
    touches[c.body_a] |= stands(c.body_b);
    touches[c.body_b] |= stands(c.body_a);
  }
  islands::UpdateFreezing({energy, threshold, touches, may}, settings.freeze_count, *counters, frozen);
  for (size_t i = 0; i < n; ++i) {
    if (!frozen[i]) continue;
    frame.bodies[i].frozen = true;
    SetTwist({}, &frame.bodies[i]);
  }
}

}  // namespace islet
