// Small products that the interior point is made of: masses times velocities, and the contact matrices applied to the
// unknowns of one field. Internal to qp.
//   threads: pure functions
#pragma once

#include <vector>

#include "qp/problem.h"

namespace islet::qp {

using Velocity = Eigen::Map<Vector6>;
using ConstVelocity = Eigen::Map<const Vector6>;

inline Velocity At(std::vector<double>& values, int first) { return Velocity(&values[first]); }
inline ConstVelocity At(const std::vector<double>& values, int first) { return ConstVelocity(&values[first]); }

inline Vector6 MassTimes(const BodyTerm& body, const Vector6& v) {
  Vector6 out;
  out.head<3>() = body.mass * v.head<3>();
  out.tail<3>().noalias() = body.inertia * v.tail<3>();
  return out;
}

inline Vector6 InverseMassTimes(const BodyTerm& body, const Vector6& p) {
  Vector6 out;
  out.head<3>() = p.head<3>() / body.mass;
  out.tail<3>().noalias() = body.inverse_inertia * p.tail<3>();
  return out;
}

inline void CopyFreeVelocities(const Problem& problem, std::vector<double>* velocities) {
  velocities->clear();
  for (const BodyTerm& body : problem.bodies)
    velocities->insert(velocities->end(), body.velocity.begin(), body.velocity.end());
}

// Normal and its lever arm as side b sees them, or the other side where that is a wall.
inline Vector6 NormalRow(const ContactTerm& contact) {
  return contact.body_b >= 0 ? Vector6(contact.jacobian_b.row(0)) : Vector6(-contact.jacobian_a.row(0));
}

// Contact velocity that the unknowns of one field make.
inline Vector3 FieldVelocity(const ContactTerm& contact, int stride, int field, const std::vector<double>& y) {
  Vector3 u = Vector3::Zero();
  if (contact.body_a >= 0) u.noalias() += contact.jacobian_a * At(y, stride * contact.body_a + 6 * field);
  if (contact.body_b >= 0) u.noalias() += contact.jacobian_b * At(y, stride * contact.body_b + 6 * field);
  return u;
}

// out += sign J^T j in one field.
inline void AddForce(const ContactTerm& contact, int stride, int field, double sign, const Vector3& j,
                     std::vector<double>* out) {
  const Vector3 force = sign * j;
  if (contact.body_a >= 0)
    At(*out, stride * contact.body_a + 6 * field).noalias() += contact.jacobian_a.transpose() * force;
  if (contact.body_b >= 0)
    At(*out, stride * contact.body_b + 6 * field).noalias() += contact.jacobian_b.transpose() * force;
}

// v0 + M^-1 J^T j.
inline void VelocitiesAfter(const Problem& problem, const std::vector<Vector3>& impulses,
                            std::vector<double>* velocities) {
  velocities->assign(6 * problem.bodies.size(), 0.0);
  for (int c = 0; c < problem.num_contacts(); ++c) AddForce(problem.contacts[c], 6, 0, 1, impulses[c], velocities);
  for (int i = 0; i < problem.num_bodies(); ++i) {
    const Vector6 momentum = At(*velocities, 6 * i);
    At(*velocities, 6 * i) = problem.bodies[i].velocity + InverseMassTimes(problem.bodies[i], momentum);
  }
}

}  // namespace islet::qp
