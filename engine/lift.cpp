#include "engine/lift.h"

#include <algorithm>
#include <cmath>

namespace islet {

Vector3 PayForLift(const Vector3& gravity_W, const Lift& lift, std::span<Body> bodies) {
  // The energy of the velocities and s times the pushes is what it was plus slope s + curvature s^2 / 2.
  double owed = 0, slope = 0, curvature = 0;  // [J, J s, J s^2]
  for (const int i : lift.members) {
    const Body& body = bodies[i];
    const Vector3 along = lift.corrections[i].linear, turn = lift.turn_weight * lift.corrections[i].angular;
    slope += body.mass * along.dot(body.linear_velocity_W) + turn.dot(body.AngularMomentumW());
    curvature += body.mass * along.squaredNorm() + turn.dot(body.InertiaW() * turn);
    if (!lift.owes[i]) continue;
    owed -= body.force_W.dot(along);
    if (lift.leans) owed -= body.mass * gravity_W.dot(along);
  }
  if (owed == 0 || curvature == 0) return Vector3::Zero();
  // The smaller root; where there is none, the least energy. Who is moved down along next to no speed gets less than that
  // fall: which way is a matter of rounding there.
  const double square = slope * slope, root = square - 2 * curvature * owed;
  double push = root > 0 ? -2 * owed / (slope + std::copysign(std::sqrt(root), slope)) : -slope / curvature;
  if (owed < 0) push *= std::min(1.0, -square / (2 * curvature * owed));
  const double rest = owed + push * (slope + 0.5 * push * curvature);
  Vector3 taken = Vector3::Zero();
  double energy = 0;  // [J] of those that owe
  for (const int i : lift.members) {
    Body& body = bodies[i];
    taken -= body.mass * body.linear_velocity_W;
    body.linear_velocity_W += push * lift.corrections[i].linear;
    body.angular_velocity_W += push * lift.turn_weight * lift.corrections[i].angular;
    if (lift.owes[i]) energy += body.KineticEnergy();
  }
  // Without a wall to take momentum nothing can be slowed down alone.
  const double share = lift.leans && rest > 0 && energy > 0 ? std::sqrt(std::max(0.0, 1 - rest / energy)) : 1;
  for (const int i : lift.members) {
    Body& body = bodies[i];
    if (lift.owes[i] && share < 1) {
      body.linear_velocity_W *= share;
      body.angular_velocity_W *= share;
    }
    taken += body.mass * body.linear_velocity_W;
  }
  return taken;
}

}  // namespace islet
