// Exact Coulomb friction in IslandSolver: sweeps and Newton's method as far as the effort goes, and rounds with the interior point.
#include <algorithm>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/island_solver.h"
#include "qp/slip.h"

namespace islet::qp {
namespace {

constexpr double kLostRms = 1e-2;   // of v_ref: natural map of sweeps that have lost their way (in jams: below 4e-3)
constexpr double kWorst = 10;       // times the tolerance of the rms: what the worst contact may have of the natural map
constexpr double kBlockGain = 0.9;  // of the natural map: momentum that leaves more has gone round in circles
constexpr int kPlainSweeps = 20;    // that lead out of them
// Sweeps of single precision take 0.6 of the time, and end at a natural map of 1e-5 to 6e-5 of v_ref.
constexpr double kSingleMasses = 100;     // largest mass over the least
constexpr double kSingleAbove = 1e-4;     // of v_ref: natural map
constexpr double kRoughTolerance = 1e-4;  // of the solves that only feed the sweeps

// Small islands, by Newton's method.
constexpr int kStartBlocks = 4, kStartSweeps = 25;  // from the impulses of the frame before
constexpr double kStartGain = 0.5;                  // of the natural map, for another block
constexpr double kNewtonShare = 1e-5;               // of the tolerance: what is sought
constexpr double kNewtonPlanar = 1e-3;              // the same in the plane, where the tolerance is less
constexpr int kNewtonSteps = 150;                   // factorisations
constexpr int kBigNewtonSteps = 40;                 // the same where only thorough effort asks for them

double MassRatio(const Problem& problem) {
  const auto lighter = [](const BodyTerm& a, const BodyTerm& b) { return a.mass < b.mass; };
  const auto [least, most] = std::minmax_element(problem.bodies.begin(), problem.bodies.end(), lighter);
  return most->mass / least->mass;
}

}  // namespace

// Sweeps, as far as the effort goes; Newton's method from where they end. False where the ladder has neither, and where few bodies are
// not answered so: then the interior point says why.
bool IslandSolver::SolveExact(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                              Solution* solution) {
  const bool newton = settings.ladder.Has(Rung::kNewton) && problem.num_bodies() <= settings.effort.newton_bodies;
  if (problem.num_bodies() <= kSmallIsland) return newton && SolveByNewton(problem, settings, start, solution);
  if (!settings.ladder.Has(Rung::kSweeps)) return false;
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  const bool starts = start.size() == problem.contacts.size();
  if (starts) TakeOver(problem, start);
  NaturalMap map = starts ? MapOfSwept(problem) : NaturalMap{INFINITY, INFINITY};
  Rung rung = Rung::kSweeps;
  if (!Meets(map, goal)) {
    gauss_seidel_.Prepare(problem);
    StartFrom(problem, start);
    map = Search(problem, settings);
    const bool lost = settings.effort.sweeps >= kSweeps && map.rms > kLostRms * settings.velocity_scale;
    if (lost) map = SearchFromConvex(problem, settings, map);
    if (newton && !Meets(map, goal)) {
      const int steps = problem.num_bodies() <= kNormalEffort.newton_bodies ? kNewtonSteps : kBigNewtonSteps;
      coulomb_newton_.Solve(problem, scales_, goal, goal, steps, &swept_impulses_);
      iterations_ += coulomb_newton_.factorisations();
      rung = Rung::kNewton;
    }
    VelocitiesAfter(problem, swept_impulses_, &swept_velocities_);  // without the rounding of thousands of increments
    map = MapOfSwept(problem);
  }
  TakeSwept(problem, settings, INFINITY, solution);
  solution->rung = rung;
  solution->coulomb_reached = Meets(map, goal);
  if (!solution->coulomb_reached) solution->status = Status::kInaccurate;
  return true;
}

bool IslandSolver::Meets(const NaturalMap& map, double goal) { return map.rms <= goal && map.max <= kWorst * goal; }

// Improves swept_impulses_ and swept_velocities_ by sweeps up to the goal or the effort. Returns their map.
NaturalMap IslandSolver::Search(const Problem& problem, const Settings& settings) {
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  NaturalMap best = MapOfSwept(problem);
  best_impulses_ = swept_impulses_, best_velocities_ = swept_velocities_;
  const bool single = problem.num_bodies() >= kSingleBodies && MassRatio(problem) <= kSingleMasses;
  bool astray = false;
  for (int left = settings.effort.sweeps; left > 0 && !Meets(best, goal);) {
    const Precision precision =
        single && best.rms > kSingleAbove * settings.velocity_scale ? Precision::kSingle : Precision::kDouble;
    const int block = std::min(left, astray ? kPlainSweeps : kSweeps);
    left -= block;
    gauss_seidel_.Sweep(problem, block, 0.1 * goal, &swept_impulses_, &swept_velocities_,
                        astray ? Pace::kPlain : Pace::kMomentum, precision);
    const NaturalMap now = MapOfSwept(problem);
    astray = !astray && now.rms > kBlockGain * best.rms;
    if (now.rms < best.rms) {
      best = now;
      best_impulses_ = swept_impulses_, best_velocities_ = swept_velocities_;
    }
  }
  swept_impulses_.swap(best_impulses_), swept_velocities_.swap(best_velocities_);
  return best;
}

// Sweeps carry loads slowly: from a heavy body through light ones, or down a tower of hundreds, they do not get to the ground. What
// the convex problem without slips says is nearer then, if it has a solution.
NaturalMap IslandSolver::SearchFromConvex(const Problem& problem, const Settings& settings, const NaturalMap& swept) {
  slips_.assign(problem.contacts.size(), 0.0);
  RunInteriorPoint(problem, settings, slips_, &trial_);
  if (trial_.status != Status::kSolved || CoulombMap(problem, trial_.velocities, trial_.impulses, scales_).rms > swept.rms)
    return swept;
  swept_impulses_ = trial_.impulses, swept_velocities_ = trial_.velocities;
  return Search(problem, settings);
}

// Sweeps from the impulses of the frame before, while they pay; Newton's method from there, or from none: what it finds depends on no
// order of contacts, and of redundant impulses it finds those near the start.
bool IslandSolver::SolveByNewton(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                                 Solution* solution) {
  const double begin = Seconds();
  gauss_seidel_.Prepare(problem);
  if (StartFrom(problem, start) && settings.ladder.Has(Rung::kSweeps)) {
    double map = MapOfSwept(problem).max, before = INFINITY;
    const double goal = kNewtonShare * kAcceptShare * settings.coulomb_tolerance * settings.velocity_scale;
    for (int block = 0; block < kStartBlocks && map > goal && map < kStartGain * before; ++block) {
      before = map;
      gauss_seidel_.Sweep(problem, kStartSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_, Pace::kMomentum);
      map = MapOfSwept(problem).max;
    }
  }
  if (PolishSwept(problem, settings, solution)) return true;
  in_vain_.Add(Rung::kNewton, Seconds() - begin);
  return false;
}

// Newton's method from the swept impulses. They are the answer if it gets there, unless that has too much energy: who says which
// bounces are to blame is the interior point.
bool IslandSolver::PolishSwept(const Problem& problem, const Settings& settings, Solution* solution) {
  const double enough = kAcceptShare * settings.coulomb_tolerance * settings.velocity_scale;
  const double goal = (in_plane_ ? kNewtonPlanar : kNewtonShare) * enough;
  const NaturalMap map = coulomb_newton_.Solve(problem, scales_, goal, enough, kNewtonSteps, &swept_impulses_);
  iterations_ += coulomb_newton_.factorisations();
  VelocitiesAfter(problem, swept_impulses_, &swept_velocities_);
  const bool useful = KineticEnergy(problem, swept_velocities_.data()) <= (1 + settings.tolerance) * settings.energy_limit;
  if (!useful || !(map.max <= enough) || !TakeSwept(problem, settings, kAcceptShare, solution)) return false;
  if (coulomb_newton_.factorisations() > 0 || !settings.ladder.Has(Rung::kSweeps)) solution->rung = Rung::kNewton;
  return true;
}

// Each round asks whether the slips that its problem assumed are those of its answer. The rounds before the last one
// need not be accurate: they only place the sweeps, which find the slips of the next. The best answer of all rounds that
// were solved to the tolerance is returned. The first round has no slips, so that an island in which nothing slides gets the
// one answer of the convex problem, whatever the order of its contacts.
void IslandSolver::SolveCoulomb(const Problem& problem, const Settings& settings, Solution* solution) {
  const bool circular = settings.cone == Cone::kCircular;
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  slips_.assign(problem.contacts.size(), 0.0);
  if (circular) gauss_seidel_.Prepare(problem);
  const bool small = problem.num_bodies() <= kSmallIsland;
  Settings inner = settings;
  if (small) inner.aim = kSmallAim;
  double best = INFINITY;
  bool accurate = small;
  int round = 1;
  for (;; ++round) {
    accurate = accurate || round >= settings.coulomb_rounds || iterations_ >= settings.patience;
    inner.tolerance = accurate ? settings.tolerance : std::max(settings.tolerance, kRoughTolerance);
    const bool near = !small && circular && round > 1;  // to what the last sweeps found
    RunInteriorPoint(problem, inner, slips_, &trial_, near ? swept_impulses_ : std::span<const Vector3>());
    if (trial_.status == Status::kFailed || trial_.status == Status::kInfeasible) {
      if (!std::isfinite(best)) *solution = trial_;
      if (round > 1 || !circular || iterations_ >= settings.patience) break;
      FindFirstSlips(problem, goal);
      if (SweepsSuffice(problem, settings, solution)) break;
      continue;
    }
    const double map = CoulombMap(problem, trial_.velocities, trial_.impulses, scales_).rms;
    swept_impulses_ = trial_.impulses;
    swept_velocities_ = trial_.velocities;
    if (accurate && (map < best || !circular)) {
      best = map;
      *solution = trial_;
    }
    if (circular && best <= goal) break;
    if (round >= settings.coulomb_rounds || iterations_ >= settings.patience) break;
    // Plain sweeps stay near the one answer of the convex problem; where they do not settle, another will do.
    if (circular && round == 1)
      gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_);
    if (circular && round > 1) Search(problem, settings);
    if (circular && SweepsSuffice(problem, settings, solution)) break;
    const double change = UpdateSlips(problem, settings.cone);
    const bool settled = !circular && change <= goal;
    if (settled && accurate) break;
    accurate = small || settled;  // a rough round places the slips, but is no answer
  }
  solution->rounds = round;
  solution->coulomb_reached =
      CoulombMap(problem, solution->velocities, solution->impulses, scales_).rms <= goal || !circular;
}

// The answer of the sweeps, or what Newton's method makes of it, where the ladder has these rungs and they meet the law.
bool IslandSolver::SweepsSuffice(const Problem& problem, const Settings& settings, Solution* solution) {
  if (settings.ladder.Has(Rung::kSweeps) && AcceptSweeps(problem, settings, kAcceptShare, solution)) return true;
  return settings.ladder.Has(Rung::kNewton) && PolishSwept(problem, settings, solution);
}

// The problem without slips may have no solution although the Coulomb problem has: u - target n in K* asks a sliding contact
// to open by mu |u_t| more than it should, and a jammed pile, or a body between walls that pass by, has no room for that.
void IslandSolver::FindFirstSlips(const Problem& problem, double goal) {
  swept_impulses_.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &swept_velocities_);
  gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_);
  UpdateSlips(problem, Cone::kCircular);
}

// Slips of the swept velocities; returns the largest change. Also where nothing presses: with s = 0 the convex problem
// would push such a contact open to u_n = mu |u_t|.
double IslandSolver::UpdateSlips(const Problem& problem, Cone cone) {
  double change = 0;
  for (size_t c = 0; c < slips_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3 u = ContactVelocity(contact, swept_velocities_.data()) + contact.compliance * swept_impulses_[c];
    const double slip = Slip(u, contact.friction, cone);
    change = std::max(change, std::abs(slip - slips_[c]));
    slips_[c] = slip;
  }
  return change;
}

}  // namespace islet::qp
