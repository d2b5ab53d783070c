#include "qp/cascade/island_solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/direct/octagon_contact.h"
#include "qp/direct/one_contact.h"
#include "qp/slip.h"

namespace islet::qp {
namespace {

constexpr double kGuessShare = 0.5;  // of the natural map of no impulses: what a guess must reach to be of use
constexpr double kWildShare = 30;    // of the same: what it must not exceed before it is mended
constexpr int kMendingSweeps = 20;
constexpr int kLeastSweeps = 10,
              kSmallSweeps = 60;  // which spare a small island half of its factorisations, and a quarter of the time
constexpr double kExactShare =
    1e-3;                            // of the tolerance: what a column must meet, and the gap of what is taken as it is
constexpr double kHeldShare = 1e-4;  // the same: what held before must meet, frame after frame

double Seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

bool AnyFriction(const Problem& problem) {
  return std::any_of(problem.contacts.begin(), problem.contacts.end(),
                     [](const ContactTerm& c) { return c.friction > 0; });
}

bool AnyCompliance(const Problem& problem) {
  return std::any_of(problem.contacts.begin(), problem.contacts.end(),
                     [](const ContactTerm& c) { return c.compliance > 0; });
}

// The kinetic model differs from the convex one only where something bounces.
bool IsConvex(const Problem& problem, const Settings& settings) {
  return settings.model != Model::kKinetic ||
         std::none_of(problem.contacts.begin(), problem.contacts.end(), [](const auto& c) { return c.target > 0; });
}

// The impulse of one contact alone, and the multiplier of the kinetic model's bounce. w: of the contact, u: its velocity without
// impulse. False if it is missed.
bool SolveAlone(const Matrix3& w, const Vector3& u, const ContactTerm& contact, const Settings& settings,
                Vector3* impulse, double* multiplier) {
  const double mu = contact.friction, target = contact.target;
  const Vector3 q = u - target * Vector3::UnitX();
  const bool coulomb = settings.model == Model::kCoulomb, bounces = settings.model == Model::kKinetic && target > 0;
  if (settings.cone == Cone::kOctagon && mu > 0) {
    const OctagonContact law(w, mu);
    if (bounces) return law.SolveKinetic(u, target, impulse, multiplier);
    return coulomb ? law.SolveCoulomb(q, impulse) : law.SolveConvex(q, impulse);
  }
  const OneContact law(w);
  if (bounces) return law.SolveKinetic(u, mu, target, impulse, multiplier);
  if (!coulomb) return law.SolveConvex(q, mu, impulse);
  *impulse = law.SolveCoulomb(q, mu);
  return true;
}

bool AllFinite(const Solution& solution) {
  return std::all_of(solution.velocities.begin(), solution.velocities.end(), [](double v) { return std::isfinite(v); });
}

// No impulses, and all that goes with them.
void Prepare(const Problem& problem, Solution* solution) {
  solution->gap = 0;
  solution->status = Status::kSolved;
  solution->multipliers.clear();
  solution->bounce_multipliers.clear();
  solution->slips.assign(problem.contacts.size(), 0.0);
  solution->impulses.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &solution->velocities);
}

}  // namespace

bool IslandSolver::AllZero(std::span<const Vector3> impulses) {
  return std::all_of(impulses.begin(), impulses.end(), [](const Vector3& j) { return j.isZero(0); });
}

void IslandSolver::Solve(const Problem& problem, const Settings& settings, Solution* solution,
                         std::span<const Vector3> start) {
  iterations_ = 0;
  in_vain_ = {};
  Prepare(problem, solution);
  if (problem.contacts.empty()) {
    solution->rung = Rung::kNothing;
  } else if (settings.ladder.Has(Rung::kClosedForm) && SolveOneContact(problem, settings, solution)) {
    solution->rung = Rung::kClosedForm;
  } else {
    Climb(problem, settings, start, solution);
  }
  solution->iterations = iterations_;
  solution->in_vain = in_vain_;
  if (!AllFinite(*solution)) solution->status = Status::kFailed;
}

// What no formula answers.
void IslandSolver::Climb(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                         Solution* solution) {
  ImpulseScales(problem, &scales_);
  if (settings.ladder.Has(Rung::kColumn) && SolveColumn(problem, settings, solution)) {
    solution->rung = Rung::kColumn;
  } else if (settings.ladder.Has(Rung::kHeld) && StillHold(problem, settings, start, solution)) {
    solution->rung = Rung::kHeld;
  } else {
    SolveWhole(problem, settings, start, solution);
  }
}

// Nearly a formula: judged like what still holds.
bool IslandSolver::SolveColumn(const Problem& problem, const Settings& settings, Solution* solution) {
  if (AnyCompliance(problem) || !IsConvex(problem, settings)) return false;
  const double begin = Seconds(), scale = settings.velocity_scale;
  const double slide = std::min(kColumnTolerance, 0.1 * kExactShare * settings.tolerance) * scale;
  if (!column_.Solve(problem, slide, solution->velocities, &swept_.impulses)) return false;
  VelocitiesAfter(problem, swept_.impulses, &swept_.velocities);
  if (IsUseful(problem, settings) && HoldsExactly(problem, settings, kExactShare, solution)) return true;
  in_vain_.Add(Rung::kColumn, Seconds() - begin);
  return false;
}

// Whether the impulses of the frame before meet the law as they are: to much more than the tolerance, since the same may be asked for
// thousands of frames, and a tower under constant impulses leans by twice as much a frame.
bool IslandSolver::StillHold(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                             Solution* solution) {
  if (start.size() != problem.contacts.size() || AnyCompliance(problem) || settings.cone != Cone::kCircular ||
      !IsConvex(problem, settings) || AllZero(start))
    return false;
  TakeOver(problem, start);
  return HoldsExactly(problem, settings, kHeldShare, solution);
}

// Whether the swept impulses meet the law to that share of the tolerance, and in other models than exact Coulomb's without slip.
bool IslandSolver::HoldsExactly(const Problem& problem, const Settings& settings, double share, Solution* solution) {
  const double goal = share * settings.tolerance * settings.velocity_scale;
  if (!(MapOfSwept(problem).max <= goal)) return false;
  ReturnSwept(problem, settings, solution);
  if (solution->gap <= kExactShare * settings.tolerance) {
    if (settings.model == Model::kCoulomb) return true;
    const double slip = *std::max_element(solution->slips.begin(), solution->slips.end());
    std::fill(solution->slips.begin(), solution->slips.end(), 0.0);
    if (slip <= goal) return true;
  }
  Prepare(problem, solution);
  return false;
}

// By what no formula serves. Without friction the models are one, unless something bounces in the kinetic one.
void IslandSolver::SolveWhole(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                              Solution* solution) {
  const bool exact = settings.model == Model::kCoulomb, circular = settings.cone == Cone::kCircular;
  const bool rubs = AnyFriction(problem);
  if (rubs ? exact && circular : IsConvex(problem, settings)) {
    SolveExact(problem, settings, start, solution);
    if (!exact) std::fill(solution->slips.begin(), solution->slips.end(), 0.0);
  } else if (rubs && exact) {
    SolveOctagon(problem, settings, solution);
  } else {
    RunInteriorPoint(problem, settings, {}, solution);
  }
}

void IslandSolver::RunInteriorPoint(const Problem& problem, const Settings& settings, std::span<const double> slips,
                                    Solution* solution) {
  Settings inner = settings;
  if (IsSmall(problem)) inner.aim = kSmallAim;
  interior_point_.Solve(problem, inner, slips, solution);
  iterations_ += solution->iterations;
  solution->rung = Rung::kInteriorPoint;
}

bool IslandSolver::SolveOneContact(const Problem& problem, const Settings& settings, Solution* solution) {
  if (problem.contacts.size() != 1 || problem.contacts[0].compliance > 0) return false;
  const double begin = Seconds();
  const ContactTerm& contact = problem.contacts[0];
  const Matrix3 w = DelassusBlock(problem, contact);
  const Vector3 u = ContactVelocity(contact, solution->velocities.data());
  double multiplier = 0;
  if (!SolveAlone(w, u, contact, settings, &solution->impulses[0], &multiplier)) {
    solution->impulses[0].setZero();
    in_vain_.Add(Rung::kClosedForm, Seconds() - begin);
    return false;
  }
  ApplyImpulse(problem, contact, solution->impulses[0], solution->velocities.data());
  if (settings.model == Model::kCoulomb)
    solution->slips[0] = Slip(ContactVelocity(contact, solution->velocities.data()), contact.friction, settings.cone);
  if (!IsConvex(problem, settings)) {
    solution->bounce_multipliers = {multiplier};
    solution->multipliers = solution->velocities;
    ApplyImpulse(problem, contact, {-multiplier, 0, 0}, solution->multipliers.data());
  }
  return true;
}

void IslandSolver::TakeNone(const Problem& problem) {
  swept_.impulses.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &swept_.velocities);
}

// The caller's impulses, one per contact, inside the cones.
void IslandSolver::TakeOver(const Problem& problem, std::span<const Vector3> start) {
  swept_.impulses.resize(start.size());
  for (size_t c = 0; c < start.size(); ++c)
    swept_.impulses[c] = ProjectOnCircularCone(start[c], problem.contacts[c].friction);
  VelocitiesAfter(problem, swept_.impulses, &swept_.velocities);
}

// Takes over impulses from the caller, or none if those are of no use; returns their map. Of thousands a few dozen do not fit, since
// contacts came and went, and make the whole worse than none: a few sweeps mend that. None of a small island are not swept: what
// Newton's method finds from there depends on no order of contacts.
NaturalMap IslandSolver::StartFrom(const Problem& problem, const Settings& settings, std::span<const Vector3> start) {
  double map_of_start = INFINITY;
  if (start.size() == problem.contacts.size() && !AllZero(start)) {
    TakeOver(problem, start);
    const NaturalMap map = MapOfSwept(problem);
    if (map.Meets(settings.tolerance * settings.velocity_scale)) return map;
    map_of_start = map.rms;
    std::swap(swept_, before_);
  }
  TakeNone(problem);
  const NaturalMap without = MapOfSwept(problem);
  if (!(map_of_start < kWildShare * without.rms)) return without;
  std::swap(swept_, before_);
  const NaturalMap swept = SweepOn(problem);
  if (swept.rms < kGuessShare * without.rms) return swept;
  std::swap(swept_, before_);
  return without;
}

// A tower, a bridge.
bool IslandSolver::HasFewLoops(const Problem& problem) {
  int pairs = 0, last_a = -1, last_b = -1;
  for (const ContactTerm& c : problem.contacts) {  // in order of pairs
    if (c.body_a < 0 || c.body_b < 0 || (c.body_a == last_a && c.body_b == last_b)) continue;
    last_a = c.body_a;
    last_b = c.body_b;
    ++pairs;
  }
  return pairs < problem.num_bodies() + kFewLoops;
}

void IslandSolver::PrepareSweeps(const Problem& problem) {
  if (!prepared_) gauss_seidel_.Prepare(problem);
  prepared_ = true;
}

// A few sweeps; most of the way, on a small island.
NaturalMap IslandSolver::SweepOn(const Problem& problem) {
  PrepareSweeps(problem);
  const int sweeps =
      IsSmall(problem) ? std::min(kSmallSweeps, kLeastSweeps + 2 * problem.num_contacts()) : kMendingSweeps;
  gauss_seidel_.Sweep(problem, sweeps, 0, &swept_.impulses, &swept_.velocities, Pace::kMomentum);
  return MapOfSwept(problem);
}

NaturalMap IslandSolver::MapOfSwept(const Problem& problem) const {
  return CoulombMap(problem, swept_.velocities, swept_.impulses, scales_);
}

// Who says which bounces are to blame for too much energy is the interior point.
bool IslandSolver::IsUseful(const Problem& problem, const Settings& settings) const {
  return KineticEnergy(problem, swept_.velocities.data()) <= (1 + settings.gap_tolerance()) * settings.energy_limit;
}

// Impulses, and velocities that must be exactly those that they make. A contact's slip gives way by as much as it approaches faster
// than it may: with these slips the answer is feasible.
void IslandSolver::ReturnSwept(const Problem& problem, const Settings& settings, Solution* solution) {
  double gap = 0, energy = 0;
  solution->slips.resize(problem.contacts.size());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3& j = swept_.impulses[c];
    Vector3 u = ContactVelocity(contact, swept_.velocities.data()) + contact.compliance * j;
    u[0] -= contact.target;
    const double slip = Slip(u, contact.friction, Cone::kCircular) + std::max(0.0, -u[0]);
    solution->slips[c] = slip;
    u[0] += slip;
    gap += std::abs(j.dot(u));
  }
  const double scale = settings.velocity_scale;
  for (const BodyTerm& body : problem.bodies)
    energy += 0.5 * body.mass * (body.velocity.head<3>().squaredNorm() + scale * scale);
  solution->impulses = swept_.impulses;
  solution->velocities = swept_.velocities;
  solution->gap = gap / energy;
}

}  // namespace islet::qp
