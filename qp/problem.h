// One island's contact problem, in velocities and impulses.
//
//   bodies    mass matrix M_i = diag(m I, I_W), velocity v0_i = (linear, angular), 6 numbers, world frame
//   contacts  velocity u_c = J_a v_a + J_b v_b + drift, normal part first; J_a carries the minus sign of body a;
//             body -1 is immovable (a wall, a frozen body), its own motion is in `drift`
//
// Sought: v and impulses j with M (v - v0) = J^T j and the law of qp::Model between j and u - target n.
// Units are the caller's; the solver works in units of its own. The laws: qp/README.md.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace islet::qp {

using Vector3 = Eigen::Matrix<double, 3, 1>;   // of a contact: (n, t1, t2)
using Vector6 = Eigen::Matrix<double, 6, 1>;   // of a body: (linear, angular), world frame
using Matrix3 = Eigen::Matrix<double, 3, 3>;   // of a body or of a contact
using Jacobian = Eigen::Matrix<double, 3, 6>;  // takes a body's velocity to its part of a contact's

// A body that moves.
struct BodyTerm {
  double mass = 1;                                // > 0
  Matrix3 inertia = Matrix3::Identity();          // symmetric positive definite
  Matrix3 inverse_inertia = Matrix3::Identity();  // of `inertia`
  Vector6 velocity = Vector6::Zero();             // v0
};

// A contact point of one or two of them.
struct ContactTerm {
  int body_a = -1, body_b = -1;            // at least one >= 0, never equal
  Jacobian jacobian_a = Jacobian::Zero();  // zero if body_a is -1
  Jacobian jacobian_b = Jacobian::Zero();  // zero if body_b is -1
  Vector3 drift = Vector3::Zero();         // contact velocity that the unknown bodies do not make
  double friction = 0;                     // mu >= 0
  double target = 0;                       // b: normal velocity required while the contact presses
  double compliance = 0;                   // >= 0; u + compliance j takes the place of u (0: rigid)
};

struct Problem {
  std::vector<BodyTerm> bodies;       // by the numbers that contacts name
  std::vector<ContactTerm> contacts;  // points, each by itself

  int num_bodies() const { return static_cast<int>(bodies.size()); }      // that move
  int num_contacts() const { return static_cast<int>(contacts.size()); }  // points
  void Clear() { bodies.clear(), contacts.clear(); }                      // keeps the memory

  // Throws std::invalid_argument that names the field, its place and the value.
  void Validate() const;
};

// u_c for the given velocities, 6 numbers a body.
Vector3 ContactVelocity(const ContactTerm& contact, const double* velocities);

// 1/2 v^T M v for the given velocities, 6 numbers a body, or the free ones if there are none (null).
double KineticEnergy(const Problem& problem, const double* velocities);
// [velocity] of the contacts, rms: how fast bodies slide, roll and part. 0: they move as one, or not at all.
double ContactSpeed(const Problem& problem, const double* velocities);

// W_cc = J_c M^-1 J_c^T, the contact's own block of the Delassus operator.
Matrix3 DelassusBlock(const Problem& problem, const ContactTerm& contact);

// Its trace alone.
double DelassusTrace(const Problem& problem, const ContactTerm& contact);

// velocities += M^-1 J_c^T impulse for the bodies of one contact.
void ApplyImpulse(const Problem& problem, const ContactTerm& contact, const Vector3& impulse, double* velocities);

}  // namespace islet::qp
