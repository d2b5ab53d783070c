#include "engine/island_spin.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace islet {
namespace {

constexpr double kNoise = 1e-9;       // of the kinetic energy: what bodies move relative to each other may be rounding
constexpr double kFlat = 1e-5;        // of the largest moment of inertia: no turn about such an axis
constexpr double kRounding = 1e-15;   // of the angular momenta's sizes
constexpr double kShiftShare = 1e-2;  // of what shifts contribute where bodies can turn as well
constexpr double kMostShift = 0.1;    // of the bodies' mean distance from their centre: a round shifts none farther
constexpr int kRounds = 8;

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

// own: what each body has about its own centre, too.
Matrix3 InertiaOf(std::span<const int> members, std::span<const Body> bodies, const Centre& centre, bool own) {
  Matrix3 inertia = Matrix3::Zero();  // [kg m^2]
  for (const int i : members) {
    const Vector3 r = bodies[i].position_W - centre.position_W;
    inertia += bodies[i].mass * (r.squaredNorm() * Matrix3::Identity() - r * r.transpose());
    if (own) inertia += bodies[i].InertiaW();
  }
  return inertia;
}

// The smallest turn [rad/s] whose angular momentum comes nearest to the wanted one: points in line cannot turn about it.
Vector3 LeastTurn(const Matrix3& inertia, const Vector3& momentum) {
  const Eigen::SelfAdjointEigenSolver<Matrix3> axes(inertia);
  Vector3 turn = Vector3::Zero();
  for (int k = 0; k < 3; ++k) {
    if (axes.eigenvalues()[k] <= kFlat * axes.eigenvalues()[2]) continue;
    turn += axes.eigenvectors().col(k).dot(momentum) / axes.eigenvalues()[k] * axes.eigenvectors().col(k);
  }
  return turn;
}

IslandSpin SpinAbout(const Vector3& point_W, std::span<const int> members, std::span<const Body> bodies) {
  IslandSpin spin{.point_W = point_W};
  for (const int i : members) {
    const Body& body = bodies[i];
    spin.angular_momentum_W +=
        (body.position_W - point_W).cross(body.mass * body.linear_velocity_W) + body.AngularMomentumW();
    spin.energy += body.KineticEnergy();
    spin.scale += body.mass * (body.position_W - point_W).norm() * body.linear_velocity_W.norm();
  }
  return spin;
}

// What velocities beside the common one can take up: shifting body i by v_i x y changes the angular momentum by this times y,
// and neither the common centre nor any velocity.
Matrix3 ShiftTensor(std::span<const int> members, std::span<const Body> bodies, const Centre& centre) {
  Matrix3 tensor = Matrix3::Zero();  // [kg m^2 / s^2]
  for (const int i : members) {
    const Vector3 v = bodies[i].linear_velocity_W - centre.velocity_W;
    tensor += bodies[i].mass * (v.squaredNorm() * Matrix3::Identity() - v * v.transpose());
  }
  return tensor;
}

}  // namespace

IslandSpin SpinOf(std::span<const int> members, std::span<const Body> bodies) {
  return SpinAbout(CentreOf(members, bodies).position_W, members, bodies);
}

void RestoreSpin(const IslandSpin& before, std::span<const int> members, std::span<Body> bodies) {
  const Centre centre = CentreOf(members, bodies);
  // The centres turn about the common one; where these are in line and cannot, they are shifted besides. Smooth balls get no
  // spin that way. Both at once is right to first order, so some rounds.
  Matrix3 points;
  for (int round = 0; round < kRounds; ++round) {
    points = InertiaOf(members, bodies, centre, false);
    const Matrix3 shifts = ShiftTensor(members, bodies, centre);
    const double weight = shifts.trace() > 0 ? kShiftShare * points.trace() / shifts.trace() : 0;  // [s^2]
    const IslandSpin now = SpinAbout(before.point_W, members, bodies);
    const Vector3 missing = before.angular_momentum_W - now.angular_momentum_W;
    if (missing.norm() <= kRounding * before.scale) break;
    const bool last = round + 1 == kRounds;
    Vector3 turn =
        LeastTurn(last ? InertiaOf(members, bodies, centre, true) : Matrix3(points + weight * shifts), missing);
    if (!last) {
      double farthest = 0;
      for (const int i : members)
        farthest = std::max(farthest, weight * (bodies[i].linear_velocity_W - centre.velocity_W).cross(turn).norm());
      const double most = kMostShift * std::sqrt(0.5 * points.trace() / centre.mass);
      if (farthest > most) turn *= most / farthest;
    }
    for (const int i : members) {
      Body& body = bodies[i];
      const Vector3 arm = body.position_W - centre.position_W;
      if (last) {
        body.angular_velocity_W += turn;
      } else {
        body.position_W += weight * (body.linear_velocity_W - centre.velocity_W).cross(turn);
      }
      body.linear_velocity_W += turn.cross(arm);
    }
  }
  // Of all motions of the centres with these momenta the rigid one has the least energy; what goes on beside it is scaled.
  double own = 0, linear = 0;
  Vector3 momentum = Vector3::Zero();
  for (const int i : members) {
    const double part = 0.5 * bodies[i].mass * bodies[i].linear_velocity_W.squaredNorm();
    linear += part;
    own += bodies[i].KineticEnergy() - part;
    momentum += (bodies[i].position_W - centre.position_W).cross(bodies[i].mass * bodies[i].linear_velocity_W);
  }
  const Vector3 spin = LeastTurn(points, momentum);
  const double rigid = 0.5 * centre.mass * centre.velocity_W.squaredNorm() + 0.5 * spin.dot(momentum);
  const double beside = linear - rigid;
  if (beside <= kNoise * linear) return;
  const double share = std::sqrt(std::max(0.0, (before.energy - own - rigid) / beside));
  for (const int i : members) {
    const Vector3 with = centre.velocity_W + spin.cross(bodies[i].position_W - centre.position_W);
    bodies[i].linear_velocity_W = with + share * (bodies[i].linear_velocity_W - with);
  }
}

}  // namespace islet
