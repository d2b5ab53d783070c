// One contact point between two bodies, and the frame in which impulses at it are written.
//
// Component order is normal first: (n, t1, t2). The normal points from body_a into body_b; +impulse acts on body_b,
// -impulse on body_a; the contact velocity is that of b relative to a.                       [SM04 Sec. 3.1, Eq. 3, 10]
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <tuple>

#include "engine/body.h"
#include "engine/linear_algebra.h"

namespace islet {

struct Contact {
  int body_a = -1;                      // body_a < body_b always
  int body_b = -1;                      // the normal points into it
  Vector3 point_W = Vector3::Zero();    // [m] midway between the two surfaces
  Vector3 normal_W = Vector3::UnitZ();  // unit, from a into b
  double gap = 0;                       // [m] signed distance along the normal; < 0 overlaps
  // False: still open by `gap`, and known only so that two supported bodies do not close it within the step. Such a contact
  // never bounces; the static problem lets its bodies approach at gap / dt.
  bool touches = true;
  double friction = 0;     // mu of the pair
  double restitution = 0;  // epsilon of the pair
  // [m/s] W, what the surface of b has beyond its body's velocity, less that of a: of conveyors. Its part along the normal counts for nothing.
  Vector3 surface_W = Vector3::Zero();
  std::uint32_t feature = 0;  // which features of the two shapes meet; the same point keeps its number
};

// [m/s] with which the contact separates after it was approached at the given speed: Newton's law. A slower one than `least` is none.
inline double ReboundSpeed(const Contact& contact, double approach, double least = 0) {
  const double speed = contact.restitution * approach;
  return speed < least ? 0 : speed;
}

// [m/s] at which an open contact may close, and is closed after a time [s].
inline double ClosingSpeed(const Contact& contact, double time) { return std::max(0.0, contact.gap) / time; }

// Whether the rebound from an approach [m/s], below 0 if it opens, lasts longer than the step in which gravity adds free_fall
// [m/s]. Nothing may slow it down before the blow, then.
inline bool OutlastsStep(const Contact& contact, double approach, double free_fall) {
  return 2 * contact.restitution * approach > (1 - contact.restitution) * free_fall;
}

inline constexpr double kTrembling =
    0.01;  // of weight: what of it is felt along any normal (3 mm/s at 1/30 s); of a force: a change that changes nothing

// [m/s] up to which the static problem may take an approach along with the weight of the step: gravity [m/s^2] alone makes as much
// of it within dt, and the rebound is none, or what presses the contact ends all its bounces in a fraction of the step.
inline double SlightApproach(const Contact& contact, const Vector3& gravity_W, double dt) {
  constexpr double kRebound = 0.05;  // of the speed that gravity gives along the normal: they last 2 e u / ((1 - e) g)
  const double fall = gravity_W.norm() * dt;
  const double rebound = (1 - contact.restitution) *
                         std::max(kRebound * std::abs(gravity_W.dot(contact.normal_W)) * dt, kTrembling * fall);
  return contact.restitution > 0 ? std::min(fall, rebound / contact.restitution) : fall;
}

// The order in which contacts are kept is by pair, then by feature. Here by pair alone, of contacts and of events.
inline constexpr auto EarlierPair = [](const auto& x, const auto& y) {
  return std::tie(x.body_a, x.body_b) < std::tie(y.body_a, y.body_b);
};
// Whether both are of one pair.
inline constexpr auto SamePair = [](const auto& x, const auto& y) {
  return x.body_a == y.body_a && x.body_b == y.body_b;
};
// The whole of that order.
inline bool Earlier(const Contact& x, const Contact& y) {
  return std::tie(x.body_a, x.body_b, x.feature) < std::tie(y.body_a, y.body_b, y.feature);
}

// How the coefficients of two bodies become those of their contact, where no callback of the world says otherwise.
double MixFriction(double friction_a, double friction_b);           // sqrt(mu_a mu_b)
double MixRestitution(double restitution_a, double restitution_b);  // max(e_a, e_b)

// Columns (n, t1, t2), right-handed, W. t1 and t2 depend on the normal alone, so two runs choose the same ones.
Matrix3 ContactFrame(const Vector3& normal_W);

// [m/s] W, what friction sees beside the bodies' velocities: surface_W across the normal.
inline Vector3 SurfaceSlip(const Contact& contact) {
  return contact.surface_W - contact.normal_W.dot(contact.surface_W) * contact.normal_W;
}
// [m/s] W, that of two bodies (Body::surface_velocity_B) where they meet.
inline Vector3 MixSurfaces(const Body& a, const Body& b) {
  if (a.surface_velocity_B.isZero(0) && b.surface_velocity_B.isZero(0)) return Vector3::Zero();
  return b.rotation_WB * b.surface_velocity_B - a.rotation_WB * a.surface_velocity_B;
}

// [m/s] of b relative to a at the contact point, W, with their surfaces.
Vector3 RelativeVelocity(const Contact& contact, const Body& a, const Body& b);

// Gives the two bodies of a contact its impulse [N s] on body_b at its point, as far as they move.
void ApplyImpulse(const Contact& contact, const Vector3& impulse_W, std::span<Body> bodies);

// [m/s] normal part of RelativeVelocity; < 0 while the bodies approach.                                  [SM04 Eq. 10]
double NormalVelocity(const Contact& contact, const Body& a, const Body& b);

}  // namespace islet
