#include "qp/cascade/candidate.h"

#include <algorithm>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/slip.h"

namespace islet::qp {

void ReturnNone(const Problem& problem, Solution* solution) {
  solution->gap = 0;
  solution->status = Status::kSolved;
  solution->multipliers.clear();
  solution->bounce_multipliers.clear();
  solution->slips.assign(problem.contacts.size(), 0.0);
  solution->impulses.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &solution->velocities);
}

void Candidate::TakeNone(const Problem& problem) {
  impulses.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &velocities);
}

void Candidate::TakeOver(const Problem& problem, std::span<const Vector3> start) {
  impulses.resize(start.size());
  for (size_t c = 0; c < start.size(); ++c) impulses[c] = ProjectOnCircularCone(start[c], problem.contacts[c].friction);
  VelocitiesAfter(problem, impulses, &velocities);
}

NaturalMap Candidate::MapOf(const Task& task) const {
  return CoulombMap(task.problem, velocities, impulses, task.scales);
}

bool Candidate::IsUseful(const Task& task) const {
  return KineticEnergy(task.problem, velocities.data()) <=
         (1 + task.settings.gap_tolerance()) * task.settings.energy_limit;
}

// A contact's slip gives way by as much as it approaches faster than it may: with these slips the answer is feasible.
void Candidate::Return(const Task& task, Solution* solution) const {
  const Problem& problem = task.problem;
  double gap = 0, energy = 0;
  solution->slips.resize(problem.contacts.size());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3& j = impulses[c];
    Vector3 u = ContactVelocity(contact, velocities.data()) + contact.compliance * j;
    u[0] -= contact.target;
    const double slip = Slip(u, contact.friction, Cone::kCircular) + std::max(0.0, -u[0]);
    solution->slips[c] = slip;
    u[0] += slip;
    gap += std::abs(j.dot(u));
  }
  for (const BodyTerm& body : problem.bodies)
    energy += 0.5 * body.mass * (body.velocity.head<3>().squaredNorm() + task.scale() * task.scale());
  solution->impulses = impulses;
  solution->velocities = velocities;
  solution->gap = gap / energy;
}

bool Candidate::ReturnIfExact(const Task& task, double share, Solution* solution) const {
  const double goal = share * task.settings.tolerance * task.scale();
  if (!(MapOf(task).max <= goal)) return false;
  Return(task, solution);
  if (solution->gap <= kExactShare * task.settings.tolerance) {
    if (task.coulomb()) return true;
    const double slip = *std::max_element(solution->slips.begin(), solution->slips.end());
    std::fill(solution->slips.begin(), solution->slips.end(), 0.0);
    if (slip <= goal) return true;
  }
  ReturnNone(task.problem, solution);
  return false;
}

}  // namespace islet::qp
