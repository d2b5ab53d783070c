#include "engine/motion/ride.h"

#include <algorithm>
#include <cmath>

#include "qp/smallness.h"

namespace islet::motion {

Vector3 SurfaceChange(const Body& a, const Body& b, const Vector3& point_W) {
  const auto change = [&](const Body& body) -> Vector3 {
    const Vector3 belt = body.rotation_WB * (body.surface_velocity_B - body.surface_before_B);
    if (body.kind != BodyKind::kKinematic) return belt;
    return belt + body.linear_velocity_W - body.linear_before_W +
           (body.angular_velocity_W - body.angular_before_W).cross(point_W - body.position_W);
  };
  return change(b) - change(a);
}

bool Ride::Find(double h, double pull, double floor, const Settings& settings, std::span<const Body> bodies,
                std::span<const Contact> contacts, std::span<const Vector3> forces_W, IslandResponder* responder) {
  Clear();
  const auto change = [&](const Contact& c) { return SurfaceChange(bodies[c.body_a], bodies[c.body_b], c.point_W); };
  bool any = false;
  for (size_t c = 0; c < contacts.size() && !any; ++c) any = !forces_W[c].isZero(0) && !change(contacts[c]).isZero(0);
  if (!any) return false;
  // In changes of velocities: bodies have none, walls half of theirs.
  posed_.assign(bodies.begin(), bodies.end());
  cut_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i) {
    Body& p = posed_[i];
    cut_[i] = !p.Moves();
    const bool wall = p.kind == BodyKind::kKinematic;
    p.linear_velocity_W = wall ? Vector3(0.5 * (p.linear_velocity_W - p.linear_before_W)) : Vector3(Vector3::Zero());
    p.angular_velocity_W = wall ? Vector3(0.5 * (p.angular_velocity_W - p.angular_before_W)) : Vector3(Vector3::Zero());
  }
  held_.clear();
  held_of_.clear();
  edges_.clear();
  frames_.clear();
  for (size_t c = 0; c < contacts.size(); ++c) {
    Contact contact = contacts[c];
    const Body &a = bodies[contact.body_a], &b = bodies[contact.body_b];
    const Vector3& n = contact.normal_W;
    const double press = n.dot(forces_W[c]);
    if (press <= 0 || (!a.Moves() && !b.Moves()) || std::abs(n.dot(change(contact))) > pull * h) continue;
    contact.surface_W = 0.5 * (b.rotation_WB * (b.surface_velocity_B - b.surface_before_B) -
                               a.rotation_WB * (a.surface_velocity_B - a.surface_before_B));
    const auto across = [&](const Vector3& v) { return (v - n.dot(v) * n).norm(); };
    const double slid = across(RelativeVelocity(contacts[c], a, b) - change(contact));  // as the step before ended
    if (slid > 10 * settings.tolerance * floor ||
        across(change(contact)) > (1 + kNegligible) * contact.friction * pull * h)
      contact.friction = 0;
    held_.push_back(contact);
    held_of_.push_back(static_cast<int>(c));
    frames_.push_back(ContactFrame(n));
    edges_.emplace_back(contact.body_a, contact.body_b);
  }
  islands::BuildPartition({cut_, edges_}, &partition_);
  targets_.assign(held_.size(), 0.0);
  local_.resize(held_.size());
  before_W_.resize(held_.size());
  impulses_W_.assign(contacts.size(), Vector3::Zero());
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const IslandView view{partition_.bodies_of(island), partition_.contacts_of(island)};
    if (std::all_of(view.contacts.begin(), view.contacts.end(), [&](int k) { return change(held_[k]).isZero(0); }))
      continue;
    // Held as if by a load that nothing lifts, with the friction of half a step: whether it may be pulled is known where the piece ends.
    double mass = 0, most = 0;
    for (const int b : view.bodies) mass += bodies[b].mass;
    for (const int k : view.contacts) most = std::max(most, change(held_[k]).norm());
    for (const int k : view.contacts) {
      Contact& contact = held_[k];
      const double press = 0.5 * h * contact.normal_W.dot(forces_W[held_of_[k]]), load = press + mass * most;
      contact.friction *= press / load;
      before_W_[k] = load * contact.normal_W;
      local_[k] = frames_[k].transpose() * before_W_[k];
      ApplyImpulse(contact, -before_W_[k], posed_);
    }
    const ResponseOutcome outcome =
        responder->ResolveTargets(view, {held_, frames_}, targets_, settings, floor, posed_, local_);
    if (outcome.status == QpStatus::kFailed) continue;
    for (const int k : view.contacts) impulses_W_[held_of_[k]] = frames_[k] * local_[k] - before_W_[k];
  }
  return true;
}

void Ride::Drop(size_t contact) {
  for (int island = 0; island < partition_.num_islands(); ++island) {
    const std::span<const int> together = partition_.contacts_of(island);
    if (std::any_of(together.begin(), together.end(), [&](int k) { return held_of_[k] == static_cast<int>(contact); }))
      for (const int k : together) impulses_W_[held_of_[k]].setZero();
  }
}

}  // namespace islet::motion
