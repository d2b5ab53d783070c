#include "qp/island_solver.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace islet::qp {
namespace {

constexpr int kSmallIsland = 12;          // bodies
constexpr int kSweeps = 100;              // between two interior-point solves
constexpr double kRoughTolerance = 1e-4;  // of the solves that only feed the sweeps

double TangentSize(const Vector3& u) { return std::sqrt(u[1] * u[1] + u[2] * u[2]); }

// De Saxce's term: mu |u_t|; for the octagon the support function of its base, which is largest at an edge.
double Slip(const Vector3& u, double friction, Cone cone) {
  if (cone == Cone::kCircular) return friction * TangentSize(u);
  double largest = 0;
  for (int k = 0; k < 8; ++k) {
    const double angle = (0.5 + k) * std::numbers::pi / 4;
    largest = std::max(largest, -(std::cos(angle) * u[1] + std::sin(angle) * u[2]));
  }
  return friction * largest;
}

Vector3 ProjectOnCircularCone(const Vector3& x, double friction) {
  const double tangent = TangentSize(x);
  if (tangent <= friction * x[0]) return x;
  if (x[0] + friction * tangent <= 0) return Vector3::Zero();
  const double normal = (x[0] + friction * tangent) / (1 + friction * friction);
  const double share = tangent > 0 ? friction * normal / tangent : 0;
  return {normal, share * x[1], share * x[2]};
}

void CopyFreeVelocities(const Problem& problem, std::vector<double>* velocities) {
  velocities->clear();
  for (const BodyTerm& body : problem.bodies) velocities->insert(velocities->end(), body.velocity.begin(), body.velocity.end());
}

bool AnyBounces(const Problem& problem) {
  return std::any_of(problem.contacts.begin(), problem.contacts.end(), [](const ContactTerm& c) { return c.target > 0; });
}

bool AllFinite(const Solution& solution) {
  return std::all_of(solution.velocities.begin(), solution.velocities.end(), [](double v) { return std::isfinite(v); });
}

}  // namespace

NaturalMap CoulombMap(const Problem& problem, const std::vector<double>& velocities, const std::vector<Vector3>& impulses) {
  double sum = 0, largest = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const double rho = 3 / DelassusBlock(problem, contact).trace();
    Vector3 u = ContactVelocity(contact, velocities.data()) + contact.compliance * impulses[c];
    u[0] += contact.friction * TangentSize(u) - contact.target;
    const Vector3 map = (impulses[c] - ProjectOnCircularCone(impulses[c] - rho * u, contact.friction)) / rho;
    sum += map.squaredNorm();
    largest = std::max(largest, map.squaredNorm());
  }
  return {std::sqrt(largest), std::sqrt(sum / std::max(1, problem.num_contacts()))};
}

void IslandSolver::Solve(const Problem& problem, const Settings& settings, Solution* solution) {
  solution->iterations = solution->rounds = 0;
  solution->gap = 0;
  solution->status = Status::kSolved;
  solution->multipliers.clear();
  solution->bounce_multipliers.clear();
  solution->slips.assign(problem.contacts.size(), 0.0);
  solution->impulses.assign(problem.contacts.size(), Vector3::Zero());
  if (problem.contacts.empty() || (problem.contacts.size() == 1 && settings.model == Model::kCoulomb &&
                                   settings.cone == Cone::kCircular && problem.contacts[0].compliance == 0)) {
    CopyFreeVelocities(problem, &solution->velocities);
    if (!problem.contacts.empty()) SolveOneContact(problem, solution);
  } else if (settings.model == Model::kCoulomb) {
    SolveCoulomb(problem, settings, solution);
  } else {
    interior_point_.Solve(problem, settings, {}, solution);
  }
  if (!AllFinite(*solution)) solution->status = Status::kFailed;
}

void IslandSolver::SolveOneContact(const Problem& problem, Solution* solution) const {
  const ContactTerm& contact = problem.contacts[0];
  const OneContact law(DelassusBlock(problem, contact));
  Vector3 q = ContactVelocity(contact, solution->velocities.data());
  q[0] -= contact.target;
  solution->impulses[0] = law.SolveCoulomb(q, contact.friction);
  ApplyImpulse(problem, contact, solution->impulses[0], solution->velocities.data());
  solution->slips[0] = contact.friction * TangentSize(ContactVelocity(contact, solution->velocities.data()));
}

// Slips of the swept velocities; returns the largest change. Also where nothing presses: with s = 0 the convex problem
// would push such a contact open to u_n = mu |u_t|.
double IslandSolver::UpdateSlips(const Problem& problem, Cone cone) {
  double change = 0;
  for (size_t c = 0; c < slips_.size(); ++c) {
    const double slip = Slip(ContactVelocity(problem.contacts[c], swept_velocities_.data()), problem.contacts[c].friction, cone);
    change = std::max(change, std::abs(slip - slips_[c]));
    slips_[c] = slip;
  }
  return change;
}

// The sweeps meet the exact law by themselves: their answer, with its own slips, and velocities without the rounding of
// thousands of increments.
void IslandSolver::AcceptSweeps(const Problem& problem, double velocity_scale, Solution* solution) {
  solution->impulses = swept_impulses_;
  CopyFreeVelocities(problem, &solution->velocities);
  for (int c = 0; c < problem.num_contacts(); ++c)
    ApplyImpulse(problem, problem.contacts[c], solution->impulses[c], solution->velocities.data());
  double gap = 0, energy = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3& j = solution->impulses[c];
    Vector3 u = ContactVelocity(contact, solution->velocities.data()) + contact.compliance * j;
    solution->slips[c] = Slip(u, contact.friction, Cone::kCircular);
    u[0] += solution->slips[c] - contact.target;
    gap += std::abs(j.dot(u));
  }
  for (const BodyTerm& body : problem.bodies) energy += 0.5 * body.mass * (body.velocity.head<3>().squaredNorm() + velocity_scale * velocity_scale);
  solution->gap = gap / energy;
  solution->status = Status::kSolved;
}

// With bounces the problem without slips may have no solution although the Coulomb problem has: u - target n in K* asks a
// sliding contact to open by mu |u_t| more than it should, and a jammed pile has no room for that.
void IslandSolver::FindFirstSlips(const Problem& problem, double goal) {
  swept_impulses_.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &swept_velocities_);
  gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_);
  UpdateSlips(problem, Cone::kCircular);
}

// Each round asks whether the slips that its problem assumed are those of its answer. The rounds before the last one
// need not be accurate: they only place the sweeps, which find the slips of the next.
void IslandSolver::SolveCoulomb(const Problem& problem, const Settings& settings, Solution* solution) {
  const bool circular = settings.cone == Cone::kCircular;
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  slips_.assign(problem.contacts.size(), 0.0);
  Settings inner = settings;
  int iterations = 0;
  if (circular) gauss_seidel_.Prepare(problem);
  const bool small = problem.num_bodies() <= kSmallIsland;  // accuracy costs next to nothing, and sweeps alone often do
  if (circular && (small || AnyBounces(problem))) {
    FindFirstSlips(problem, goal);
    if (CoulombMap(problem, swept_velocities_, swept_impulses_).max <= goal) return AcceptSweeps(problem, settings.velocity_scale, solution);
  }
  bool last = small;
  for (int round = 1;; ++round) {
    last = last || round >= settings.coulomb_rounds;
    inner.tolerance = last ? settings.tolerance : std::max(settings.tolerance, kRoughTolerance);
    interior_point_.Solve(problem, inner, slips_, solution);
    solution->slips = slips_;
    iterations += solution->iterations;
    solution->iterations = iterations;
    solution->rounds = round;
    if (solution->status == Status::kFailed || solution->status == Status::kInfeasible) return;
    const double map = CoulombMap(problem, solution->velocities, solution->impulses).rms;
    if ((circular && last && map <= goal) || round >= settings.coulomb_rounds) return;

    swept_impulses_ = solution->impulses;
    swept_velocities_ = solution->velocities;
    if (circular) gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_);
    const double change = UpdateSlips(problem, settings.cone);
    const double swept_map = circular ? CoulombMap(problem, swept_velocities_, swept_impulses_).max : change;
    if (circular && swept_map <= goal) return AcceptSweeps(problem, settings.velocity_scale, solution);
    last = small;
    if (!circular && change <= goal) return;
  }
}

}  // namespace islet::qp
