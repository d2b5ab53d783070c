#include "engine/island_spin.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace islet {
namespace {

constexpr double kNoise = 1e-9;  // of the kinetic energy: what bodies move relative to each other may be rounding

constexpr double kOwnShare =
    1e-3;  // bodies turn about their common centre, hardly about their own: smooth balls do not spin

struct Centre {
  double mass = 0;                       // [kg]
  Vector3 position_W = Vector3::Zero();  // [m]
  Vector3 velocity_W = Vector3::Zero();  // [m/s]
};

Centre CentreOf(std::span<const int> members, std::span<const Body> bodies) {
  Centre centre;
  for (const int i : members) {
    centre.mass += bodies[i].mass;
    centre.position_W += bodies[i].mass * bodies[i].position_W;
    centre.velocity_W += bodies[i].mass * bodies[i].linear_velocity_W;
  }
  centre.position_W /= centre.mass;
  centre.velocity_W /= centre.mass;
  return centre;
}

// own: the share of what each body has about its own centre.
Matrix3 InertiaOf(std::span<const int> members, std::span<const Body> bodies, const Centre& centre, double own) {
  Matrix3 inertia = Matrix3::Zero();  // [kg m^2]
  for (const int i : members) {
    const Vector3 r = bodies[i].position_W - centre.position_W;
    inertia +=
        own * bodies[i].InertiaW() + bodies[i].mass * (r.squaredNorm() * Matrix3::Identity() - r * r.transpose());
  }
  return inertia;
}

IslandSpin SpinAbout(const Vector3& point_W, std::span<const int> members, std::span<const Body> bodies) {
  IslandSpin spin{.point_W = point_W};
  for (const int i : members) {
    const Body& body = bodies[i];
    spin.angular_momentum_W +=
        (body.position_W - point_W).cross(body.mass * body.linear_velocity_W) + body.AngularMomentumW();
    spin.energy += body.KineticEnergy();
  }
  return spin;
}

}  // namespace

IslandSpin SpinOf(std::span<const int> members, std::span<const Body> bodies) {
  return SpinAbout(CentreOf(members, bodies).position_W, members, bodies);
}

void RestoreSpin(const IslandSpin& before, std::span<const int> members, std::span<Body> bodies) {
  const Centre centre = CentreOf(members, bodies);
  const IslandSpin now = SpinAbout(before.point_W, members, bodies);
  const Vector3 turn = Eigen::LDLT<Matrix3>(InertiaOf(members, bodies, centre, kOwnShare))
                           .solve(before.angular_momentum_W - now.angular_momentum_W);  // [rad/s]
  if (!turn.allFinite()) return;
  double energy = 0;
  for (const int i : members) {
    bodies[i].linear_velocity_W += turn.cross(bodies[i].position_W - centre.position_W);
    bodies[i].angular_velocity_W += kOwnShare * turn;
    energy += bodies[i].KineticEnergy();
  }
  // The rigid motion that has these momenta has the least energy of all that do; what goes on beside it is scaled.
  const Vector3 orbit = (centre.position_W - before.point_W).cross(centre.mass * centre.velocity_W);
  const Vector3 momentum = before.angular_momentum_W - orbit;
  const Vector3 spin = Eigen::LDLT<Matrix3>(InertiaOf(members, bodies, centre, 1)).solve(momentum);
  const double rigid = 0.5 * centre.mass * centre.velocity_W.squaredNorm() + 0.5 * spin.dot(momentum);
  const double beside = energy - rigid;
  if (beside <= kNoise * energy) return;
  const double share = std::sqrt(std::max(0.0, (before.energy - rigid) / beside));
  for (const int i : members) {
    const Vector3 linear = centre.velocity_W + spin.cross(bodies[i].position_W - centre.position_W);
    bodies[i].linear_velocity_W = linear + share * (bodies[i].linear_velocity_W - linear);
    bodies[i].angular_velocity_W = spin + share * (bodies[i].angular_velocity_W - spin);
  }
}

}  // namespace islet
