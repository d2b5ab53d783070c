#include "bench/clients/undo_overlaps.h"

#include <algorithm>

#include "engine/rotation.h"

namespace islet::clients {
namespace {

constexpr double kAtOnce = 0.01;  // of the smaller radius: overlap that is undone in one step
constexpr double kShare = 0.2;    // of what is deeper
constexpr double kTouch = 5e-4;   // of the smaller radius: nearer points touch

double Size(const Contact& c, std::span<const Body> bodies) {
  return std::min(bodies[c.body_a].radius, bodies[c.body_b].radius);
}

}  // namespace

bool Touches(const Contact& c, std::span<const Body> bodies) { return c.gap <= kTouch * Size(c, bodies); }

void UndoOverlaps(std::span<Body> bodies, std::span<Contact> contacts, std::vector<Contact>* scratch,
                  ContactSuite* suite) {
  scratch->assign(contacts.begin(), contacts.end());
  for (Contact& c : *scratch) c.gap = std::max(c.gap, std::min(-kAtOnce * Size(c, bodies), kShare * c.gap));
  suite->Project(bodies, *scratch);
  const std::span<const Twist> w = suite->displacements();
  const auto moved = [&](int body, const Vector3& point) -> Vector3 {
    return w[body].linear_W + w[body].angular_W.cross(point - bodies[body].position_W);
  };
  for (Contact& c : contacts) {
    c.gap += c.normal_W.dot(moved(c.body_b, c.point_W) - moved(c.body_a, c.point_W));
    c.touches = c.touches || Touches(c, bodies);
  }
  for (size_t i = 0; i < bodies.size(); ++i) {
    if (!bodies[i].Moves()) continue;
    bodies[i].position_W += w[i].linear_W;
    bodies[i].rotation_WB = (Exp(w[i].angular_W) * bodies[i].rotation_WB).normalized();
  }
}

}  // namespace islet::clients
