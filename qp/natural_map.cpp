#include "qp/natural_map.h"

#include <algorithm>
#include <cmath>

namespace islet::qp {

void ImpulseScales(const Problem& problem, std::vector<double>* rho) {
  rho->clear();
  for (const ContactTerm& contact : problem.contacts) rho->push_back(3 / DelassusTrace(problem, contact));
}

NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities,
                      const std::vector<Vector3>& impulses) {
  std::vector<double> rho;
  ImpulseScales(problem, &rho);
  return CoulombMap(problem, velocities, impulses, rho);
}

NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities,
                      const std::vector<Vector3>& impulses, const std::vector<double>& rho) {
  double sum = 0, largest = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    Vector3 u = ContactVelocity(contact, velocities.data()) + contact.compliance * impulses[c];
    u[0] += contact.friction * std::sqrt(u[1] * u[1] + u[2] * u[2]) - contact.target;
    const Vector3 map = (impulses[c] - ProjectOnCircularCone(impulses[c] - rho[c] * u, contact.friction)) / rho[c];
    sum += map.squaredNorm();
    largest = std::max(largest, map.squaredNorm());
  }
  return {std::sqrt(largest), std::sqrt(sum / std::max(1, problem.num_contacts()))};
}

Vector3 ProjectOnCircularCone(const Vector3& x, double friction) {
  const double tangent = std::sqrt(x[1] * x[1] + x[2] * x[2]);
  if (tangent <= friction * x[0]) return x;
  if (x[0] + friction * tangent <= 0) return Vector3::Zero();
  const double normal = (x[0] + friction * tangent) / (1 + friction * friction);
  const double share = tangent > 0 ? friction * normal / tangent : 0;
  return {normal, share * x[1], share * x[2]};
}

}  // namespace islet::qp
