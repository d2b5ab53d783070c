#include "engine/contact.h"

#include <algorithm>
#include <cmath>

namespace islet {

double MixFriction(double friction_a, double friction_b) { return std::sqrt(friction_a * friction_b); }

double MixRestitution(double restitution_a, double restitution_b) { return std::max(restitution_a, restitution_b); }

// Every continuous choice of tangents on the sphere fails somewhere. This one, the reflection that takes a pole to the
// normal applied to fixed tangents of the pole, fails at the pole alone and keeps full accuracy up to about 1e-8 from
// it. The pole is a direction that no scene's floor or wall faces. Fixed tangents are such that e_z gets (e_x, e_y).
Matrix3 ContactFrame(const Vector3& normal_W) {
  const Vector3 pole = Vector3(-6, -10, -15) / 19;
  const Vector3 pole_tangent_1 = Vector3(305, -30, -102) / 323;
  const Vector3 pole_tangent_2 = Vector3(-30, 273, -170) / 323;
  Vector3 mirror = normal_W - pole;
  if (mirror.isZero(0)) mirror = pole_tangent_1;  // any mirror that holds the pole makes the frame right-handed
  const double scale = 2 / mirror.squaredNorm();
  Matrix3 frame;
  frame.col(0) = normal_W;
  frame.col(1) = pole_tangent_1 - (scale * mirror.dot(pole_tangent_1)) * mirror;
  frame.col(2) = pole_tangent_2 - (scale * mirror.dot(pole_tangent_2)) * mirror;
  return frame;
}

void ApplyImpulse(const Contact& contact, const Vector3& impulse_W, std::span<Body> bodies) {
  Body &a = bodies[contact.body_a], &b = bodies[contact.body_b];
  if (a.Moves()) a.ApplyImpulse(-impulse_W, contact.point_W);
  if (b.Moves()) b.ApplyImpulse(impulse_W, contact.point_W);
}

Vector3 RelativeVelocity(const Contact& contact, const Body& a, const Body& b) {
  return b.VelocityAt(contact.point_W) - a.VelocityAt(contact.point_W) + SurfaceSlip(contact);
}

double NormalVelocity(const Contact& contact, const Body& a, const Body& b) {
  return contact.normal_W.dot(b.VelocityAt(contact.point_W) - a.VelocityAt(contact.point_W));
}

}  // namespace islet
