#include "engine/rebound.h"

#include <algorithm>

#include "engine/suite_frame.h"

namespace islet {
namespace {

constexpr double kRounding = 1e-5;   // of the weight times dt: what a solver leaves at contacts that do not push
constexpr double kTrembling = 1e-5;  // of what gravity adds in the step: slower is at rest

constexpr double kNone = 1e-9;  // of the same: bodies that move as one approach by rounding errors

// [m/s] of the contact if its bodies had these velocities.
double NormalSpeed(const Contact& contact, const Twist& a, const Twist& b, std::span<const Body> bodies) {
  const auto velocity = [&](int i, const Twist& twist) -> Vector3 {
    return twist.linear_W + twist.angular_W.cross(contact.point_W - bodies[i].position_W);
  };
  return contact.normal_W.dot(velocity(contact.body_b, b) - velocity(contact.body_a, a));
}

// [1/kg] normal velocity per normal impulse.
double NormalResponse(const Contact& contact, std::span<const Body> bodies) {
  double response = 0;
  for (const int i : {contact.body_a, contact.body_b}) {
    const Body& body = bodies[i];
    if (!body.Moves()) continue;
    const Vector3 lever = (contact.point_W - body.position_W).cross(contact.normal_W);
    response += 1 / body.mass + lever.dot(body.InverseInertiaW() * lever);
  }
  return response;
}

bool SamePair(const Contact& x, const Contact& y) { return x.body_a == y.body_a && x.body_b == y.body_b; }

// [N s] static impulses of the last step, at contacts of the pair that rebounded in it and are gone: the largest. `place`: of the
// first of last_contacts that is not earlier than `contact`.
double OwedByGone(const Contact& contact, size_t place, std::span<const Contact> last_contacts,
                  std::span<const Vector3> last_holding, std::span<const Contact> contacts) {
  const auto gone = [&](const Contact& last) {
    return !std::binary_search(contacts.begin(), contacts.end(), last, Earlier);
  };
  double owed = 0;
  const auto include = [&](size_t p) {
    if (last_contacts[p].rebounds && last_holding[p][0] > owed && gone(last_contacts[p])) owed = last_holding[p][0];
  };
  for (size_t p = place; p > 0 && SamePair(last_contacts[p - 1], contact); --p) include(p - 1);
  for (size_t p = place; p < last_contacts.size() && SamePair(last_contacts[p], contact); ++p) include(p);
  return owed;
}

}  // namespace

void SetRebounds(double free_fall, std::span<const Body> bodies, std::span<const Contact> last_contacts,
                 std::span<const Vector3> last_holding, std::span<Contact> contacts) {
  size_t p = 0;
  for (Contact& contact : contacts) {
    contact.rebounds = false;
    contact.fading = 0;
    if (!contact.touches || !(contact.restitution > 0)) continue;
    const double approach = -NormalVelocity(contact, bodies[contact.body_a], bodies[contact.body_b]);
    contact.rebounds = approach > kNone * free_fall;
    if (!contact.rebounds) continue;
    while (p < last_contacts.size() && Earlier(last_contacts[p], contact)) ++p;
    const bool stays = p < last_contacts.size() && !Earlier(contact, last_contacts[p]);
    const double held = stays ? last_holding[p][0] : OwedByGone(contact, p, last_contacts, last_holding, contacts);
    if (!(held > 0)) continue;
    // What a blow from elsewhere adds to the approach rebounds by Newton's law.
    const double lost = 0.5 * (1 - contact.restitution) * NormalResponse(contact, bodies) * held;
    contact.fading = std::min(lost, contact.restitution * approach);
  }
}

double RoundingOf(const Vector3& gravity_W, double dt, const Body& body) {
  return kRounding * body.mass * (gravity_W.norm() * dt + 1e-3 * body.linear_velocity_W.norm());
}

Twist BeforeForces(double dt, const Vector3& gravity_W, const Body& body) {
  if (!body.Moves()) return TwistOf(body);
  const Twist forces = ChangeByForces(dt, gravity_W, body);
  return {body.linear_velocity_W - forces.linear_W, body.angular_velocity_W - forces.angular_W};
}

double SpeedBeforeForces(const Contact& contact, const Vector3& gravity_W, double dt, std::span<const Body> bodies) {
  return NormalSpeed(contact, BeforeForces(dt, gravity_W, bodies[contact.body_a]),
                     BeforeForces(dt, gravity_W, bodies[contact.body_b]), bodies);
}

void BouncedMotion::Restore(double dt, const Vector3& gravity_W, std::span<const Body> bodies,
                            std::span<const Contact> contacts, std::span<const Vector3> holding,
                            std::vector<Twist>* before) {
  const double trembling = kTrembling * gravity_W.norm() * dt;
  const auto pushed = [&](int i, double impulse) {
    return bodies[i].Moves() && impulse > RoundingOf(gravity_W, dt, bodies[i]);
  };
  const auto held = [&](size_t c) {
    const double impulse = holding[c].norm();
    return contacts[c].touches && (pushed(contacts[c].body_a, impulse) || pushed(contacts[c].body_b, impulse));
  };
  any_ = false;
  for (size_t c = 0; c < contacts.size(); ++c) {
    const int a = contacts[c].body_a, b = contacts[c].body_b;
    if (!contacts[c].rebounds || !held(c) || NormalVelocity(contacts[c], bodies[a], bodies[b]) >= -trembling) continue;
    if (!any_) bounced_.assign(bodies.size(), 0);
    any_ = true;
    for (const int i : {a, b})
      if (bodies[i].Moves()) bounced_[i] = kBounced;
  }
  if (!any_) return;
  earlier_.resize(bodies.size());
  for (size_t i = 0; i < bodies.size(); ++i)
    earlier_[i] = bounced_[i] ? BeforeForces(dt, gravity_W, bodies[i]) : TwistOf(bodies[i]);
  for (size_t c = 0; c < contacts.size(); ++c) {
    if (holding[c].isZero(0)) continue;
    const Vector3 impulse_W = ContactFrame(contacts[c].normal_W) * holding[c];
    for (const int i : {contacts[c].body_a, contacts[c].body_b}) {
      if (!bounced_[i]) continue;
      const Vector3 taken = i == contacts[c].body_a ? impulse_W : Vector3(-impulse_W);
      earlier_[i].linear_W += taken / bodies[i].mass;
      earlier_[i].angular_W += bodies[i].InverseInertiaW() * (contacts[c].point_W - bodies[i].position_W).cross(taken);
    }
  }
  // Where a contact of theirs would do work all the same, they keep their final velocities.
  for (size_t c = 0; c < contacts.size(); ++c) {
    const int a = contacts[c].body_a, b = contacts[c].body_b;
    if (((bounced_[a] | bounced_[b]) & kBounced) && held(c) &&
        NormalSpeed(contacts[c], earlier_[a], earlier_[b], bodies) + NormalVelocity(contacts[c], bodies[a], bodies[b]) >
            trembling)
      bounced_[a] |= kGains, bounced_[b] |= kGains;
  }
  for (size_t i = 0; i < bodies.size(); ++i)
    if (bounced_[i] == kBounced) (*before)[i] = earlier_[i];
}

}  // namespace islet
