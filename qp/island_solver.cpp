#include "qp/island_solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

namespace islet::qp {
namespace {

constexpr double kAcceptShare = 0.7;  // of the tolerance: what sweeps must reach to be taken as the answer
constexpr double kSmallAim = 1e-15;   // of the gap, where iterations cost microseconds
constexpr int kSmallRounds = 5;       // times the cap on rounds, where they cost microseconds
constexpr int kSmallIsland = 12;      // bodies
constexpr int kSweeps = 100;          // a block
constexpr int kMaxBlocks = 10;        // of sweeps
constexpr double kEnoughRms = 3;      // times the tolerance: natural map at which the search ends
constexpr double kEnoughMax = 30;
constexpr int kRestIterations = 14;    // resting islands take 9 to 12
constexpr double kGuessShare = 0.5;    // of the natural map of no impulses: what a guess must reach to be of use
constexpr double kSprawl = 10;         // times mass times v_ref: impulses that may be larger than they need to
constexpr double kLostRms = 1e-3;      // of v_ref: natural map of sweeps that have lost their way
constexpr double kBlockGain = 0.7;     // of the natural map, for another block
constexpr double kHeldShare = 1e-3;    // of the tolerance: what held before must meet, frame after frame
constexpr double kNormalShare = 1e-2;  // of the tolerance: natural map without friction
constexpr int kNormalFactorisations = 6;
constexpr double kNormalStart = 1e-5;  // of v_ref: natural map (rms) of sweeps from which Newton's method gets there
constexpr int kHeldSweeps = 30;
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

void CopyFreeVelocities(const Problem& problem, std::vector<double>* velocities) {
  velocities->clear();
  for (const BodyTerm& body : problem.bodies)
    velocities->insert(velocities->end(), body.velocity.begin(), body.velocity.end());
}

bool AnyFriction(const Problem& problem) {
  return std::any_of(problem.contacts.begin(), problem.contacts.end(),
                     [](const ContactTerm& c) { return c.friction > 0; });
}

// One contact: exact Coulomb on the circular cone, and without friction every model, is a formula.
bool HasClosedForm(const Problem& problem, const Settings& settings) {
  if (problem.contacts.size() != 1 || problem.contacts[0].compliance > 0) return false;
  if (problem.contacts[0].friction == 0) return settings.model != Model::kKinetic || problem.contacts[0].target <= 0;
  return settings.model == Model::kCoulomb && settings.cone == Cone::kCircular;
}

// Between a floor and a ceiling impulses can grow without bound and do nothing; the interior point goes to where they are
// largest.
bool Sprawls(const Problem& problem, const Settings& settings, const Solution& solution) {
  double mass = 0, pressed = 0;
  for (const BodyTerm& body : problem.bodies) mass += body.mass;
  for (const Vector3& j : solution.impulses) pressed += j[0];
  return pressed > kSprawl * mass * settings.velocity_scale;
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

double Seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

bool AllFinite(const Solution& solution) {
  return std::all_of(solution.velocities.begin(), solution.velocities.end(), [](double v) { return std::isfinite(v); });
}

}  // namespace

NaturalMap IslandSolver::MapOfSwept(const Problem& problem) const {
  return CoulombMap(problem, swept_velocities_, swept_impulses_, scales_);
}

void IslandSolver::Solve(const Problem& problem, const Settings& settings, Solution* solution,
                         std::span<const Vector3> start) {
  iterations_ = escalations_ = 0;
  seconds_in_vain_ = 0;
  solution->rounds = 0;
  solution->gap = 0;
  solution->coulomb_reached = true;
  solution->status = Status::kSolved;
  solution->multipliers.clear();
  solution->bounce_multipliers.clear();
  solution->slips.assign(problem.contacts.size(), 0.0);
  solution->impulses.assign(problem.contacts.size(), Vector3::Zero());
  if (problem.contacts.empty()) {
    CopyFreeVelocities(problem, &solution->velocities);
    solution->rung = Rung::kNothing;
  } else if (settings.ladder.Has(Rung::kClosedForm) && HasClosedForm(problem, settings)) {
    CopyFreeVelocities(problem, &solution->velocities);
    SolveOneContact(problem, solution);
    solution->rung = Rung::kClosedForm;
  } else if (settings.ladder.Has(Rung::kHeld) && StillHold(problem, settings, start, solution)) {
    solution->rung = Rung::kHeld;
  } else if (AnyFriction(problem) && settings.model == Model::kCoulomb) {
    const bool swept = settings.tier == Tier::kSwept, big = problem.num_bodies() > kSmallIsland;
    if (settings.cone == Cone::kCircular && (big || swept)) {
      SolveBigCoulomb(problem, settings, start, solution);
    } else {
      SolveCoulomb(problem, settings, solution);
    }
  } else if (AnyFriction(problem) || !settings.ladder.Has(Rung::kNormal) ||
             !SolveNormal(problem, settings, start, solution)) {
    Settings inner = settings;
    if (problem.num_bodies() <= kSmallIsland) inner.aim = kSmallAim;
    RunInteriorPoint(problem, inner, {}, solution);
  }
  solution->iterations = iterations_;
  solution->escalations = escalations_;
  solution->seconds_in_vain = seconds_in_vain_;
  if (!AllFinite(*solution)) solution->status = Status::kFailed;
}

void IslandSolver::RunInteriorPoint(const Problem& problem, const Settings& settings, std::span<const double> slips,
                                    Solution* solution, std::span<const Vector3> near) {
  interior_point_.Solve(problem, settings, slips, solution, near);
  iterations_ += solution->iterations;
  solution->rung = Rung::kInteriorPoint;
}

// Whether the impulses of the frame before meet the law as they are: to much more than the tolerance, since the same may be
// asked for thousands of frames. A few sweeps take back what rounding has added up. Where contacts slide the models differ:
// there only the exact law is served.
bool IslandSolver::StillHold(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                             Solution* solution) {
  if (start.size() != problem.contacts.size() || AnyCompliance(problem) || settings.cone != Cone::kCircular ||
      !IsConvex(problem, settings) ||
      std::all_of(start.begin(), start.end(), [](const Vector3& j) { return j.isZero(0); }))
    return false;
  ImpulseScales(problem, &scales_);
  CopyFreeVelocities(problem, &swept_velocities_);
  swept_impulses_.resize(start.size());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    swept_impulses_[c] = ProjectOnCircularCone(start[c], problem.contacts[c].friction);
    ApplyImpulse(problem, problem.contacts[c], swept_impulses_[c], swept_velocities_.data());
  }
  const double scale = settings.coulomb_tolerance * settings.velocity_scale;
  const double map = MapOfSwept(problem).max;
  if (!(map <= scale)) return false;
  if (map > 1e-2 * kHeldShare * scale) {
    gauss_seidel_.Prepare(problem);
    gauss_seidel_.Sweep(problem, kHeldSweeps, 1e-3 * kHeldShare * scale, &swept_impulses_, &swept_velocities_);
  }
  if (!AcceptSweeps(problem, settings, kHeldShare, solution)) return false;
  if (settings.model == Model::kCoulomb) return true;
  const double slip = *std::max_element(solution->slips.begin(), solution->slips.end());
  std::fill(solution->slips.begin(), solution->slips.end(), 0.0);
  return slip <= kHeldShare * scale;
}

// No contact has friction. False where the sweeps do not get near an answer, or there is none: bounces that contradict each
// other, walls that close on a body.
bool IslandSolver::SolveNormal(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                               Solution* solution) {
  if (AnyCompliance(problem) || !IsConvex(problem, settings)) return false;
  const double begin = Seconds(), goal = kNormalShare * settings.coulomb_tolerance * settings.velocity_scale;
  ImpulseScales(problem, &scales_);
  gauss_seidel_.Prepare(problem);
  StartFrom(problem, start);
  gauss_seidel_.Sweep(problem, kSweeps, goal, &swept_impulses_, &swept_velocities_, Pace::kMomentum);
  if (MapOfSwept(problem).rms > kNormalStart * settings.velocity_scale) return false;
  const bool solved = normal_newton_.Solve(problem, goal, kNormalFactorisations, &swept_impulses_);
  iterations_ += normal_newton_.factorisations();
  if (!solved) {
    ++escalations_;
    seconds_in_vain_ += Seconds() - begin;
    return false;
  }
  solution->impulses = swept_impulses_;
  CopyFreeVelocities(problem, &solution->velocities);
  for (int c = 0; c < problem.num_contacts(); ++c)
    ApplyImpulse(problem, problem.contacts[c], solution->impulses[c], solution->velocities.data());
  solution->rung = Rung::kNormal;
  return true;
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
    const double slip =
        Slip(ContactVelocity(problem.contacts[c], swept_velocities_.data()), problem.contacts[c].friction, cone);
    change = std::max(change, std::abs(slip - slips_[c]));
    slips_[c] = slip;
  }
  return change;
}

// Takes the answer of the sweeps if it meets the exact law by itself, to `share` of the tolerance: with its own slips, and with velocities without the
// rounding of thousands of increments.
bool IslandSolver::AcceptSweeps(const Problem& problem, const Settings& settings, double share, Solution* solution) {
  const double scale = settings.velocity_scale, goal = share * settings.coulomb_tolerance;
  if (MapOfSwept(problem).max > goal * scale) return false;
  CopyFreeVelocities(problem, &swept_velocities_);
  for (int c = 0; c < problem.num_contacts(); ++c)
    ApplyImpulse(problem, problem.contacts[c], swept_impulses_[c], swept_velocities_.data());
  double gap = 0, energy = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3& j = swept_impulses_[c];
    Vector3 u = ContactVelocity(contact, swept_velocities_.data()) + contact.compliance * j;
    u[0] += Slip(u, contact.friction, Cone::kCircular) - contact.target;
    gap += std::abs(j.dot(u));
  }
  for (const BodyTerm& body : problem.bodies)
    energy += 0.5 * body.mass * (body.velocity.head<3>().squaredNorm() + scale * scale);
  if (gap > goal * energy) return false;
  solution->impulses = swept_impulses_;
  solution->velocities = swept_velocities_;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const Vector3 u = ContactVelocity(problem.contacts[c], swept_velocities_.data());
    solution->slips[c] = Slip(u, problem.contacts[c].friction, Cone::kCircular);
  }
  solution->gap = gap / energy;
  solution->status = Status::kSolved;
  solution->rung = Rung::kSweeps;
  return true;
}

// The problem without slips may have no solution although the Coulomb problem has: u - target n in K* asks a sliding contact
// to open by mu |u_t| more than it should, and a jammed pile, or a body between walls that pass by, has no room for that.
void IslandSolver::FindFirstSlips(const Problem& problem, double goal) {
  swept_impulses_.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &swept_velocities_);
  gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_);
  UpdateSlips(problem, Cone::kCircular);
}

// Each round asks whether the slips that its problem assumed are those of its answer. The rounds before the last one
// need not be accurate: they only place the sweeps, which find the slips of the next. The best answer of all rounds that
// were solved to the tolerance is returned. The first round has no slips, so that an island in which nothing slides gets the
// one answer of the convex problem, whatever the order of its contacts.
void IslandSolver::SolveCoulomb(const Problem& problem, const Settings& settings, Solution* solution) {
  const bool circular = settings.cone == Cone::kCircular;
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  slips_.assign(problem.contacts.size(), 0.0);
  ImpulseScales(problem, &scales_);
  if (circular) gauss_seidel_.Prepare(problem);
  const bool small = problem.num_bodies() <= kSmallIsland;
  Settings inner = settings;
  if (small) inner.aim = kSmallAim;
  double best = INFINITY;
  bool accurate = small;
  const int cap = settings.coulomb_rounds * (small ? kSmallRounds : 1);
  for (int round = 1;; ++round) {
    accurate = accurate || round >= cap;
    inner.tolerance = accurate ? settings.tolerance : std::max(settings.tolerance, kRoughTolerance);
    RunInteriorPoint(problem, inner, slips_, &trial_);
    trial_.rounds = round;
    if (trial_.status == Status::kFailed || trial_.status == Status::kInfeasible) {
      if (!std::isfinite(best)) *solution = trial_;
      if (round > 1 || !circular) break;
      FindFirstSlips(problem, goal);
      if (AcceptSweeps(problem, settings, kAcceptShare, solution)) break;
      continue;
    }
    const double map = CoulombMap(problem, trial_.velocities, trial_.impulses, scales_).rms;
    swept_impulses_ = trial_.impulses;
    swept_velocities_ = trial_.velocities;
    if (accurate && (map < best || !circular)) {
      best = map;
      *solution = trial_;
    }
    if ((circular && best <= goal) || round >= cap) break;
    // Plain sweeps stay near the one answer of the convex problem; where they do not settle, another will do.
    if (circular && round == 1) gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_);
    if (circular && round > 1) Search(problem, settings);
    const double change = UpdateSlips(problem, settings.cone);
    if (circular && AcceptSweeps(problem, settings, kAcceptShare, solution)) break;
    const bool settled = !circular && change <= goal;
    if (settled && accurate) break;
    accurate = small || settled;  // a rough round places the slips, but is no answer
  }
  if (circular && Sprawls(problem, settings, *solution)) {
    StartFrom(problem, {});
    Search(problem, settings);
    AcceptSweeps(problem, settings, kAcceptShare, solution);
  }
  solution->coulomb_reached =
      CoulombMap(problem, solution->velocities, solution->impulses, scales_).rms <= goal || !circular;
}

// Improves swept_impulses_ and swept_velocities_ by sweeps, as long as that pays. An answer that is to be certified goes on
// until it can be accepted as it is: that is better than what the interior point makes of it, and cheaper.
void IslandSolver::Search(const Problem& problem, const Settings& settings) {
  const bool certified = settings.tier == Tier::kCertified;
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  NaturalMap best = MapOfSwept(problem);
  best_impulses_ = swept_impulses_, best_velocities_ = swept_velocities_;
  const auto enough = [&](const NaturalMap& map) {
    return map.max <= kAcceptShare * goal ||
           (!certified && map.rms <= kEnoughRms * goal && map.max <= kEnoughMax * goal);
  };
  bool pays = true;
  for (int block = 0; block < kMaxBlocks && pays && !enough(best); ++block) {
    gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_, Pace::kMomentum);
    const NaturalMap now = MapOfSwept(problem);
    pays = now.rms < kBlockGain * best.rms;
    if (now.rms < best.rms) {
      best = now;
      best_impulses_ = swept_impulses_, best_velocities_ = swept_velocities_;
    }
  }
  swept_impulses_.swap(best_impulses_), swept_velocities_.swap(best_velocities_);
}

// Sweeps carry loads slowly: in a tower of hundreds they do not get to the ground. What the convex problem without slips
// says is nearer then, if it has a solution.
void IslandSolver::SearchFromConvex(const Problem& problem, const Settings& settings) {
  const double rms = MapOfSwept(problem).rms;
  std::fill(slips_.begin(), slips_.end(), 0.0);
  RunInteriorPoint(problem, settings, slips_, &trial_);
  if (trial_.status != Status::kSolved || CoulombMap(problem, trial_.velocities, trial_.impulses, scales_).rms > rms)
    return;
  swept_impulses_ = trial_.impulses, swept_velocities_ = trial_.velocities;
  Search(problem, settings);
}

// Takes over impulses from the caller, or none if those are of no use.
void IslandSolver::StartFrom(const Problem& problem, std::span<const Vector3> start) {
  swept_impulses_.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &swept_velocities_);
  if (start.size() != problem.contacts.size()) return;
  const double without = MapOfSwept(problem).rms;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    swept_impulses_[c] = ProjectOnCircularCone(start[c], problem.contacts[c].friction);
    ApplyImpulse(problem, problem.contacts[c], swept_impulses_[c], swept_velocities_.data());
  }
  if (MapOfSwept(problem).rms < kGuessShare * without) return;
  swept_impulses_.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &swept_velocities_);
}

// Where hardly anything slides the convex problem without slips is all but the answer, and sweeps find the rest; elsewhere
// the sweeps start from the impulses at hand. What they leave over is the friction of contacts on the edge of sliding: the
// convex problem with the slips found is solved to the tolerance, so that all but those slips is exact.
void IslandSolver::SolveBigCoulomb(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                                   Solution* solution) {
  slips_.assign(problem.contacts.size(), 0.0);
  ImpulseScales(problem, &scales_);
  gauss_seidel_.Prepare(problem);
  StartFrom(problem, start);
  const bool certified = settings.tier == Tier::kCertified;
  if (certified && settings.expect_rest) {
    Settings brief = settings;
    brief.max_iterations = kRestIterations;
    RunInteriorPoint(problem, brief, slips_, &trial_);
    if (trial_.status == Status::kSolved) swept_impulses_ = trial_.impulses, swept_velocities_ = trial_.velocities;
  }
  Search(problem, settings);
  if (certified && MapOfSwept(problem).rms > kLostRms * settings.velocity_scale) {
    SearchFromConvex(problem, settings);
  }
  const bool accepted = AcceptSweeps(problem, settings, certified ? kAcceptShare : INFINITY, solution);
  if (!accepted) {
    UpdateSlips(problem, Cone::kCircular);
    RunInteriorPoint(problem, settings, slips_, solution, swept_impulses_);
    solution->rounds = 1;
  }
  solution->coulomb_reached = CoulombMap(problem, solution->velocities, solution->impulses, scales_).rms <=
                              settings.coulomb_tolerance * settings.velocity_scale;
}

}  // namespace islet::qp
