#include "engine/lift.h"

#include <algorithm>
#include <cmath>

namespace islet {

double PayForLift(const Vector3& gravity_W, std::span<const int> members, std::span<const std::uint8_t> pays,
                  std::span<const Displacement> corrections, double turn_weight, std::span<Body> bodies) {
  // The energy of the velocities plus s pushes is what it was plus slope s + curvature s^2 / 2.
  double owed = 0, slope = 0, curvature = 0, energy = 0;  // [J, J s, J s^2, J]
  for (const int i : members) {
    const Body& body = bodies[i];
    const Vector3 along = corrections[i].linear, turn = turn_weight * corrections[i].angular;
    slope += body.mass * along.dot(body.linear_velocity_W) + turn.dot(body.AngularMomentumW());
    curvature += body.mass * along.squaredNorm() + turn.dot(body.InertiaW() * turn);
    if (!pays[i]) continue;
    owed -= (body.mass * gravity_W + body.force_W).dot(along);
  }
  if (owed == 0 || curvature == 0) return 0;
  // The smaller root; without one, where the energy is least.
  const double root = slope * slope - 2 * curvature * owed;
  const double push = root > 0 ? -2 * owed / (slope + std::copysign(std::sqrt(root), slope)) : -slope / curvature;
  const double rest = owed + push * (slope + 0.5 * push * curvature);
  for (const int i : members) {
    Body& body = bodies[i];
    body.linear_velocity_W += push * corrections[i].linear;
    body.angular_velocity_W += push * turn_weight * corrections[i].angular;
    if (pays[i]) energy += body.KineticEnergy();
  }
  if (rest <= 0 || energy <= 0) return push;
  const double share = std::sqrt(std::max(0.0, 1 - rest / energy));
  for (const int i : members) {
    if (!pays[i]) continue;
    bodies[i].linear_velocity_W *= share;
    bodies[i].angular_velocity_W *= share;
  }
  return push;
}

}  // namespace islet
