#include "bench/answer_quality.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace islet::qp {
namespace {

Vector3 NearestInCone(const Vector3& x, double mu) {
  const double tangent = std::hypot(x[1], x[2]);
  if (x[0] + mu * tangent <= 0) return Vector3::Zero();
  if (tangent <= mu * x[0]) return x;
  const double along = (x[0] + mu * tangent) / (1 + mu * mu);  // on the edge (1, mu), the nearest point of it
  return {along, along * mu * x[1] / tangent, along * mu * x[2] / tangent};
}

}  // namespace

Quality Judge(const Island& island, const Solution& solution) {
  const Problem& problem = island.problem;
  Quality quality;
  for (size_t c = 0; c < problem.contacts.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    double trace = 0;
    for (const auto& [body, jacobian] :
         {std::pair(contact.body_a, &contact.jacobian_a), {contact.body_b, &contact.jacobian_b}}) {
      if (body < 0) continue;
      const BodyTerm& term = problem.bodies[body];
      trace += jacobian->leftCols<3>().squaredNorm() / term.mass;
      trace += (jacobian->rightCols<3>() * term.inverse_inertia * jacobian->rightCols<3>().transpose()).trace();
    }
    const Vector3& j = solution.impulses[c];
    const Vector3 u = ContactVelocity(contact, solution.velocities.data()) + contact.compliance * j;
    const Vector3 exact = u + Vector3(contact.friction * std::hypot(u[1], u[2]) - contact.target, 0, 0);
    const double map = (j - NearestInCone(j - 3 / trace * exact, contact.friction)).norm() * trace / 3 / island.scale;
    quality.rms += map * map;
    quality.max = std::max(quality.max, map);
    quality.gap += std::abs(j.dot(u + Vector3(solution.slips[c] - contact.target, 0, 0)));
  }
  quality.rms = std::sqrt(quality.rms / std::max(1, problem.num_contacts()));
  double energy = 0;
  for (const BodyTerm& body : problem.bodies) {
    const Vector3 turn = body.velocity.tail<3>();
    energy += 0.5 * body.mass * (island.scale * island.scale + body.velocity.head<3>().squaredNorm());
    energy += 0.5 * turn.dot(body.inertia * turn);
  }
  quality.gap /= energy;
  return quality;
}

}  // namespace islet::qp
