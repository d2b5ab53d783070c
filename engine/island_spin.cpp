#include "engine/island_spin.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace islet {
namespace {

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

Matrix3 InertiaOf(std::span<const int> members, std::span<const Body> bodies, const Centre& centre) {
  Matrix3 inertia = Matrix3::Zero();  // [kg m^2]
  for (const int i : members) {
    const Vector3 r = bodies[i].position_W - centre.position_W;
    inertia += bodies[i].InertiaW() + bodies[i].mass * (r.squaredNorm() * Matrix3::Identity() - r * r.transpose());
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
  const Matrix3 inertia = InertiaOf(members, bodies, centre);
  const Eigen::LDLT<Matrix3> factors(inertia);
  const IslandSpin now = SpinAbout(before.point_W, members, bodies);
  const Vector3 missing = factors.solve(before.angular_momentum_W - now.angular_momentum_W);
  if (!missing.allFinite()) return;
  // Rigid motion with the momenta that are wanted, and what is left of each velocity beside it.
  const Vector3 spin = factors.solve(before.angular_momentum_W);
  const double rigid = 0.5 * centre.mass * centre.velocity_W.squaredNorm() + 0.5 * spin.dot(before.angular_momentum_W);
  const double energy = now.energy + missing.dot(now.angular_momentum_W) + 0.5 * missing.dot(inertia * missing);
  const double own = energy - rigid;
  double share = 1;
  if (energy > before.energy && own > 0) share = std::sqrt(std::clamp((before.energy - rigid) / own, 0.0, 1.0));
  for (const int i : members) {
    Body& body = bodies[i];
    const Vector3 r = body.position_W - centre.position_W;
    body.linear_velocity_W += missing.cross(r);
    body.angular_velocity_W += missing;
    if (share == 1) continue;
    const Vector3 rigid_linear = centre.velocity_W + spin.cross(r);
    body.linear_velocity_W = rigid_linear + share * (body.linear_velocity_W - rigid_linear);
    body.angular_velocity_W = spin + share * (body.angular_velocity_W - spin);
  }
}

}  // namespace islet
