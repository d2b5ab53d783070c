#include "engine/bounce.h"

#include <algorithm>
#include <cmath>

#include "qp/one_contact.h"

namespace islet {
namespace {

constexpr double kEnergySlack = 1e-13;   // of the work: an elastic bounce gains nothing, up to rounding
constexpr double kSmallestSlip = 1e-12;  // relative to the approach: less is none

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

// The smallest energy after a bounce whose normal impulse brings about `change` of the normal velocity: with t the friction,
//   min t A t / 2 + c t   subject to  |t| <= mu j_n(t),  j_n = (change - W_nt t) / W_nn
// A = W_tt - W_tn W_nt / W_nn. t = 0 loses energy for any restitution up to 1, so the best t does too. Along a direction the
// best length is known; the direction is found by search: the energy has one minimum over a convex set.
Vector3 LeastEnergyImpulse(const Matrix3& response, const Vector3& u, double friction, double change) {
  const double normal = response(0, 0);
  const Eigen::Vector2d coupling = response.block<2, 1>(1, 0);
  const Eigen::Matrix2d stiffness = response.block<2, 2>(1, 1) - coupling * coupling.transpose() / normal;
  const Eigen::Vector2d slope = u.tail<2>() - coupling * u[0] / normal;
  const auto best_along = [&](double angle) -> Eigen::Vector2d {
    const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
    const double length = std::max(0.0, -slope.dot(direction) / direction.dot(stiffness * direction));
    const double cone = normal + friction * coupling.dot(direction);
    return (cone > 0 ? std::min(length, friction * change / cone) : length) * direction;
  };
  const auto energy = [&](double angle) {
    const Eigen::Vector2d t = best_along(angle);
    return 0.5 * t.dot(stiffness * t) + slope.dot(t);
  };
  constexpr int kDirections = 32, kSearches = 60;
  const double sector = 2 * M_PI / kDirections;
  int best = 0;
  for (int k = 1; k < kDirections; ++k)
    if (energy(k * sector) < energy(best * sector)) best = k;
  double low = (best - 1) * sector, high = (best + 1) * sector;
  for (int k = 0; k < kSearches; ++k) {
    const double third = (high - low) / 3;
    (energy(low + third) < energy(high - third) ? high : low) +=
        energy(low + third) < energy(high - third) ? -third : third;
  }
  const Eigen::Vector2d t = best_along(0.5 * (low + high));
  return {(change - coupling.dot(t)) / normal, t[0], t[1]};
}

// Newton's bounce with Coulomb friction can gain energy where slip reverses (Kane's paradox). Those bounces, and only those,
// keep Newton's rebound and get of all impulses in the friction cone the one after which the least energy is left.
Vector3 ExactImpulse(const Matrix3& response, const Vector3& u, double friction, double rebound) {
  Vector3 q = u;
  q[0] -= rebound;
  const Vector3 j = qp::OneContact(response).SolveCoulomb(q, friction);
  if (rebound == 0 || EnergyGain(response, u, j) <= kEnergySlack * std::abs(j.dot(u))) return j;
  return LeastEnergyImpulse(response, u, friction, rebound - u[0]);
}

}  // namespace

void BounceBody::ApplyImpulse(const Vector3& impulse_W, const Vector3& point_W) {
  linear_velocity_W += inverse_mass * impulse_W;
  angular_velocity_W += inverse_inertia_W * (point_W - position_W).cross(impulse_W);
}

Vector3 BounceImpulse(const BounceBody& a, const BounceBody& b, const Contact& contact, const Matrix3& frame,
                      BounceLaw law) {
  const Vector3 u = frame.transpose() * (b.VelocityAt(contact.point_W) - a.VelocityAt(contact.point_W));
  if (u[0] >= 0) return Vector3::Zero();
  const Matrix3 response = ContactResponse(a, b, contact, frame);
  if (law == BounceLaw::kExact) return ExactImpulse(response, u, contact.friction, ReboundSpeed(contact, -u[0]));
  const double slip = u.tail<2>().norm();
  // Rounding has a direction too, but no friction.
  const double share = slip > kSmallestSlip * -u[0] ? -contact.friction / slip : 0;
  const Vector3 direction(1, share * u[1], share * u[2]);
  // Eq. 2: along the normal alone; Eq. 6: along the normal with friction's share. Both then act along `direction`.
  const double per_impulse = law == BounceLaw::kEq5 ? response(0, 0) : response.row(0).dot(direction);
  return -(1 + contact.restitution) * u[0] / std::max(per_impulse, 1e-3 * response(0, 0)) * direction;
}

}  // namespace islet
