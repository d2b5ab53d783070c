#include "engine/impact/bounce.h"

#include <algorithm>
#include <cmath>

#include "qp/direct/one_contact.h"
#include "qp/smallness.h"

namespace islet {
namespace {

// [1/kg] contact velocity per impulse, in `frame`: W = F^T (m^-1 I - [r]x I^-1 [r]x) F summed over both bodies.
Matrix3 ContactResponse(const BounceBody& a, const BounceBody& b, const Contact& contact, const Matrix3& frame) {
  Matrix3 response = (a.inverse_mass + b.inverse_mass) * Matrix3::Identity();
  for (const BounceBody* body : {&a, &b}) {
    const Vector3 r = contact.point_W - body->position_W;
    Matrix3 lever;  // rows r x column of the frame
    for (int i = 0; i < 3; ++i) lever.col(i) = r.cross(frame.col(i));
    response += lever.transpose() * body->inverse_inertia_W * lever;
  }
  return response;
}

// Kinetic energy that impulse j adds to the two bodies.
double EnergyGain(const Matrix3& response, const Vector3& u, const Vector3& j) {
  return j.dot(u) + 0.5 * j.dot(response * j);
}

// Newton's bounce with Coulomb friction can gain energy where slip reverses (Kane's paradox). Those bounces, and only those,
// keep Newton's rebound and get of all impulses in the friction cone the one after which the least energy is left.
Vector3 ExactImpulse(const Matrix3& response, const Vector3& u, double friction, double rebound) {
  const qp::OneContact law(response);
  const Vector3 j = law.SolveCoulomb(u - rebound * Vector3::UnitX(), friction);
  if (rebound == 0 || EnergyGain(response, u, j) <= kExact * std::abs(j.dot(u))) return j;
  return law.LeastEnergy(u, friction, rebound);
}

}  // namespace

void BounceBody::ApplyImpulse(const Vector3& impulse_W, const Vector3& point_W) {
  linear_velocity_W += inverse_mass * impulse_W;
  angular_velocity_W += inverse_inertia_W * (point_W - position_W).cross(impulse_W);
}

Vector3 BounceImpulse(const BounceBody& a, const BounceBody& b, const Contact& contact, const Matrix3& frame,
                      BounceLaw law) {
  const Vector3 u =
      frame.transpose() * (b.VelocityAt(contact.point_W) - a.VelocityAt(contact.point_W) + SurfaceSlip(contact));
  if (u[0] >= 0) return Vector3::Zero();
  const Matrix3 response = ContactResponse(a, b, contact, frame);
  if (law == BounceLaw::kExact) return ExactImpulse(response, u, contact.friction, ReboundSpeed(contact, -u[0]));
  const double slip = u.tail<2>().norm();
  // Rounding has a direction too, but no friction.
  const double share = slip > kExact * -u[0] ? -contact.friction / slip : 0;
  const Vector3 direction(1, share * u[1], share * u[2]);
  // Eq. 2: along the normal alone; Eq. 6: along the normal with friction's share. Both then act along `direction`.
  const double per_impulse = law == BounceLaw::kEq5 ? response(0, 0) : response.row(0).dot(direction);
  return -(1 + contact.restitution) * u[0] / std::max(per_impulse, 1e-3 * response(0, 0)) * direction;
}

}  // namespace islet
