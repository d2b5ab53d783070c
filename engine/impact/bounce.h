// The impulse of one colliding contact, by the law of the settings.                         [SM04 Eq. 2, 5, 6, 11, 12]
//
// kExact is Newton's law with Coulomb friction. Where that would raise the kinetic energy (Kane's paradox: friction reverses the
// slip and does work) the rebound stays Newton's, and a small QP in the friction finds the least energy after the bounce.
//   threads: pure functions
#pragma once

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/settings.h"

namespace islet {

// A body as one bounce sees it; infinite mass is inverse_mass 0.
struct BounceBody {
  double inverse_mass = 0;                       // [1/kg]
  Matrix3 inverse_inertia_W = Matrix3::Zero();   // [1/(kg m^2)]
  Vector3 position_W = Vector3::Zero();          // [m]
  Vector3 linear_velocity_W = Vector3::Zero();   // [m/s]
  Vector3 angular_velocity_W = Vector3::Zero();  // [rad/s]

  bool moves() const { return inverse_mass > 0; }
  Vector3 VelocityAt(const Vector3& point_W) const {
    return linear_velocity_W + angular_velocity_W.cross(point_W - position_W);
  }
  void ApplyImpulse(const Vector3& impulse_W, const Vector3& point_W);
};

// [N s] on body b, components (n, t1, t2) of `frame`. Zero if the bodies do not approach.
Vector3 BounceImpulse(const BounceBody& a, const BounceBody& b, const Contact& contact, const Matrix3& frame,
                      BounceLaw law);

}  // namespace islet
