#include "qp/problem.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

#include "qp/body_algebra.h"

namespace islet::qp {
namespace {

[[noreturn]] void Reject(const std::string& where, int number, const std::string& field, double value) {
  std::ostringstream text;
  text << "qp::Problem: " << where << " " << number << ": " << field << " = " << value;
  throw std::invalid_argument(text.str());
}

void ValidateContact(const Problem& problem, int number) {
  const ContactTerm& c = problem.contacts[number];
  const int n = problem.num_bodies();
  if (c.body_a < -1 || c.body_a >= n) Reject("contact", number, "body_a", c.body_a);
  if (c.body_b < -1 || c.body_b >= n || c.body_b == c.body_a) Reject("contact", number, "body_b", c.body_b);
  if (!(c.friction >= 0) || !std::isfinite(c.friction)) Reject("contact", number, "friction", c.friction);
  if (!std::isfinite(c.target)) Reject("contact", number, "target", c.target);
  if (!(c.compliance >= 0) || !std::isfinite(c.compliance)) Reject("contact", number, "compliance", c.compliance);
  if (!c.drift.allFinite()) Reject("contact", number, "drift", c.drift.sum());
  if (!c.jacobian_a.allFinite()) Reject("contact", number, "jacobian_a", c.jacobian_a.sum());
  if (!c.jacobian_b.allFinite()) Reject("contact", number, "jacobian_b", c.jacobian_b.sum());
}

}  // namespace

void Problem::Validate() const {
  for (int i = 0; i < num_bodies(); ++i) {
    if (!(bodies[i].mass > 0) || !std::isfinite(bodies[i].mass)) Reject("body", i, "mass", bodies[i].mass);
    if (!bodies[i].velocity.allFinite()) Reject("body", i, "velocity", bodies[i].velocity.sum());
    if (!bodies[i].inertia.allFinite()) Reject("body", i, "inertia", bodies[i].inertia.sum());
    if (!bodies[i].inverse_inertia.allFinite()) Reject("body", i, "inverse_inertia", bodies[i].inverse_inertia.sum());
  }
  for (int c = 0; c < num_contacts(); ++c) ValidateContact(*this, c);
}

Vector3 ContactVelocity(const ContactTerm& contact, const double* velocities) {
  Vector3 u = contact.drift;
  if (contact.body_a >= 0) u.noalias() += contact.jacobian_a * ConstVelocity(velocities + 6 * contact.body_a);
  if (contact.body_b >= 0) u.noalias() += contact.jacobian_b * ConstVelocity(velocities + 6 * contact.body_b);
  return u;
}

double KineticEnergy(const Problem& problem, const double* velocities) {
  double energy = 0;
  for (size_t i = 0; i < problem.bodies.size(); ++i) {
    const BodyTerm& body = problem.bodies[i];
    const Vector6 v =
        velocities ? Eigen::Map<const Vector6>(velocities + 6 * i) : Eigen::Map<const Vector6>(body.velocity.data());
    energy += 0.5 * body.mass * v.head<3>().squaredNorm() + 0.5 * v.tail<3>().dot(body.inertia * v.tail<3>());
  }
  return energy;
}

double ContactSpeed(const Problem& problem, const double* velocities) {
  double sum = 0;
  for (const ContactTerm& contact : problem.contacts) sum += ContactVelocity(contact, velocities).squaredNorm();
  return std::sqrt(sum / std::max(1, problem.num_contacts()));
}

Matrix3 DelassusBlock(const Problem& problem, const ContactTerm& contact) {
  Matrix3 w = Matrix3::Zero();
  const auto add = [&](int number, const Jacobian& jacobian) {
    const BodyTerm& body = problem.bodies[number];
    w += jacobian.leftCols<3>() * jacobian.leftCols<3>().transpose() / body.mass;
    w += jacobian.rightCols<3>() * body.inverse_inertia * jacobian.rightCols<3>().transpose();
  };
  if (contact.body_a >= 0) add(contact.body_a, contact.jacobian_a);
  if (contact.body_b >= 0) add(contact.body_b, contact.jacobian_b);
  return w;
}

double DelassusTrace(const Problem& problem, const ContactTerm& contact) {
  double trace = 0;
  const auto add = [&](int number, const Jacobian& jacobian) {
    const BodyTerm& body = problem.bodies[number];
    const Matrix3 turned = jacobian.rightCols<3>() * body.inverse_inertia;
    trace += jacobian.leftCols<3>().squaredNorm() / body.mass + turned.cwiseProduct(jacobian.rightCols<3>()).sum();
  };
  if (contact.body_a >= 0) add(contact.body_a, contact.jacobian_a);
  if (contact.body_b >= 0) add(contact.body_b, contact.jacobian_b);
  return trace;
}

void ApplyImpulse(const Problem& problem, const ContactTerm& contact, const Vector3& impulse, double* velocities) {
  const auto apply = [&](int number, const Jacobian& jacobian) {
    Eigen::Map<Vector6>(velocities + 6 * number) +=
        InverseMassTimes(problem.bodies[number], jacobian.transpose() * impulse);
  };
  if (contact.body_a >= 0) apply(contact.body_a, contact.jacobian_a);
  if (contact.body_b >= 0) apply(contact.body_b, contact.jacobian_b);
}

}  // namespace islet::qp
