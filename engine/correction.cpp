#include "engine/correction.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace islet {
namespace {

constexpr double kFlat = 1e-9;  // of the largest moment of inertia

Matrix3 AboutPoint(double mass, const Vector3& r) {  // [kg m^2] of a point mass
  return mass * (r.squaredNorm() * Matrix3::Identity() - r * r.transpose());
}

// Takes energy [J] from what the centres do besides a rigid motion; both momenta stay.
void SlowDown(double energy, std::span<const int> members, std::span<Body> bodies) {
  double mass = 0, kinetic = 0;
  Vector3 centre = Vector3::Zero(), velocity = Vector3::Zero(), momentum = Vector3::Zero();
  for (const int i : members) {
    mass += bodies[i].mass;
    centre += bodies[i].mass * bodies[i].position_W;
    velocity += bodies[i].mass * bodies[i].linear_velocity_W;
  }
  centre /= mass;
  velocity /= mass;
  Matrix3 inertia = Matrix3::Zero();
  for (const int i : members) {
    const Vector3 arm = bodies[i].position_W - centre, own = bodies[i].linear_velocity_W - velocity;
    inertia += AboutPoint(bodies[i].mass, arm);
    momentum += arm.cross(bodies[i].mass * own);
    kinetic += 0.5 * bodies[i].mass * own.squaredNorm();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3> axes(inertia);
  Vector3 spin = Vector3::Zero();
  for (int k = 0; k < 3; ++k) {
    if (axes.eigenvalues()[k] <= kFlat * axes.eigenvalues()[2]) continue;  // points in line do not turn about it
    spin += axes.eigenvectors().col(k).dot(momentum) / axes.eigenvalues()[k] * axes.eigenvectors().col(k);
  }
  const double beside = kinetic - 0.5 * spin.dot(momentum);
  if (beside <= 0) return;
  const double share = std::sqrt(std::max(0.0, 1 - energy / beside));
  for (const int i : members) {
    const Vector3 rigid = velocity + spin.cross(bodies[i].position_W - centre);
    bodies[i].linear_velocity_W = rigid + share * (bodies[i].linear_velocity_W - rigid);
  }
}

}  // namespace

// The least change of kinetic energy that gives the island back its angular momentum: a turn as a whole. Returns the energy
// that it added [J].
double CorrectionBalance::TurnBack(std::span<const int> members, std::span<const Shift> shifts,
                                   std::span<Body> bodies) {
  Vector3 off = Vector3::Zero(), centre = Vector3::Zero();
  double mass = 0;
  for (const int i : members) {
    const Body& body = bodies[i];
    off += shifts[i].linear.cross(body.mass * body.linear_velocity_W) + shifts[i].spin;
    centre += body.mass * body.position_W;
    mass += body.mass;
  }
  if (off.isZero(0)) return 0;
  centre /= mass;
  Matrix3 inertia = Matrix3::Zero();
  for (const int i : members)
    inertia += bodies[i].InertiaW() + AboutPoint(bodies[i].mass, bodies[i].position_W - centre);
  const Vector3 turn = -(inertia.ldlt().solve(off));
  double added = 0;
  for (const int i : members) {
    Body& body = bodies[i];
    const double before = body.KineticEnergy();
    body.linear_velocity_W += turn.cross(body.position_W - centre);
    body.angular_velocity_W += turn;
    added += body.KineticEnergy() - before;
  }
  return added;
}

double CorrectionBalance::Settle(const Vector3& gravity_W, std::span<const int> members, std::span<const Push> pushes,
                                 std::span<const Shift> shifts, bool free, std::span<Body> bodies) {
  double lift = 0;  // [J]
  for (const int i : members) lift -= (bodies[i].mass * gravity_W + bodies[i].force_W).dot(shifts[i].linear);
  lift = std::max(lift, 0.0);
  const double owed = lift + (free ? TurnBack(members, shifts, bodies) : 0);
  if (owed == 0) return 0;
  kicks_.assign(members.size(), {Vector3::Zero(), Vector3::Zero()});
  const auto place = [&](int i) { return std::lower_bound(members.begin(), members.end(), i) - members.begin(); };
  for (const Push& push : pushes) {
    for (const auto& [i, sign] : {std::pair{push.body_a, -1.0}, {push.body_b, 1.0}}) {
      if (!bodies[i].Moves()) continue;
      Kick& kick = kicks_[place(i)];
      kick.linear += sign * push.push_W;
      kick.angular += sign * (push.point_W - bodies[i].position_W).cross(push.push_W);
    }
  }
  double slope = 0, curvature = 0;  // energy of the velocities plus x kicks: slope x + curvature x^2 / 2
  for (size_t k = 0; k < members.size(); ++k) {
    const Body& body = bodies[members[k]];
    Kick& kick = kicks_[k];
    const Vector3 torque = kick.angular;
    slope += kick.linear.dot(body.linear_velocity_W) + torque.dot(body.angular_velocity_W);
    kick.linear /= body.mass;
    kick.angular = body.InverseInertiaW() * torque;
    curvature += body.mass * kick.linear.squaredNorm() + torque.dot(kick.angular);
  }
  double scale = 0;
  if (slope != 0 && !(slope > 0 && lift > 0)) {
    const double root = slope * slope - 2 * curvature * owed;
    scale = root > 0 ? 2 * owed / (-slope + std::copysign(std::sqrt(root), -slope)) : -slope / curvature;
  }
  for (size_t k = 0; k < members.size(); ++k) {
    bodies[members[k]].linear_velocity_W += scale * kicks_[k].linear;
    bodies[members[k]].angular_velocity_W += scale * kicks_[k].angular;
  }
  const double left = owed + scale * (slope + 0.5 * scale * curvature);
  if (free && left > 0) SlowDown(left, members, bodies);
  return scale;
}

}  // namespace islet
