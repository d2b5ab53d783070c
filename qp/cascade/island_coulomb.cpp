// Exact Coulomb friction in IslandSolver.
#include <algorithm>
#include <cmath>
#include <utility>

#include "qp/body_algebra.h"
#include "qp/cascade/island_solver.h"
#include "qp/slip.h"

namespace islet::qp {
namespace {

// Big islands, by sweeps.
constexpr int kSweeps = 100;        // a block
constexpr double kLostRms = 1e-2;   // of v_ref: natural map of sweeps that have lost their way (in jams: below 4e-3)
constexpr double kBlockGain = 0.9;  // of the natural map: momentum that leaves more has gone round in circles
constexpr int kPlainSweeps = 20;    // that lead out of them
// Sweeps of single precision take 0.6 of the time, and end at a natural map of 1e-5 to 6e-5 of v_ref.
constexpr double kSingleMasses = 100;  // largest mass over the least
constexpr double kSingleAbove = 1e-4;  // of v_ref: natural map
constexpr int kBigNewtonSteps = 40;    // factorisations, where only thorough effort asks for them
// Towers, and small islands that may move inexactly.
constexpr int kTinyIsland = 8;     // bodies: there Newton's method takes no longer than sweeps
constexpr double kStill = 0.01;    // of v_ref: speed of the contacts of what stands
constexpr double kCarried = 1e-4;  // of v_ref: natural map of sweeps that get from one end to the other

// The octagon.
constexpr int kSweepsOfASolve = 30;       // what an interior-point solve counts as, of the effort
constexpr double kRoughTolerance = 1e-2;  // of the solves that only place the slips

double MassRatio(const Problem& problem) {
  const auto lighter = [](const BodyTerm& a, const BodyTerm& b) { return a.mass < b.mass; };
  const auto [least, most] = std::minmax_element(problem.bodies.begin(), problem.bodies.end(), lighter);
  return most->mass / least->mass;
}

}  // namespace

// From the impulses of the frame before as far as the effort goes; where that has lost its way, or the ladder has no rung for it, from
// the interior point. A small island that is exact, or stands, is always sent on to Newton's method: it stops where it starts if nothing is
// left to do.
void IslandSolver::SolveExact(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                              Solution* solution) {
  const double goal = settings.tolerance * settings.velocity_scale;
  const bool exact = !MayBeRough(problem, settings),
             climbs = settings.ladder.Has(Rung::kSweeps) || settings.ladder.Has(Rung::kNewton);
  solution->rung = Rung::kSweeps;
  prepared_ = false;
  NaturalMap map{INFINITY, INFINITY};
  if (climbs) {
    map = StartFrom(problem, settings, start);
    if (IsSmall(problem) || !map.Meets(goal)) map = Improve(problem, settings, map);
    if (!exact && IsLost(problem, settings, map)) map = Improve(problem, settings, map);  // mostly they find back
    if (exact && !map.Meets(goal)) map = TryAgain(problem, settings, map);
    if (iterations_ > 0) solution->rung = Rung::kNewton;
  }
  if ((!climbs || IsLost(problem, settings, map)) && SolveFromConvex(problem, settings, &map, solution)) return;
  ReturnSwept(problem, settings, solution);
  solution->status = map.Meets(goal) ? Status::kSolved : Status::kInaccurate;
}

// From what Newton's method left of a small island, by sweeps first. The nearer of both stays.
NaturalMap IslandSolver::TryAgain(const Problem& problem, const Settings& settings, const NaturalMap& found) {
  before_ = swept_;
  const NaturalMap again = Improve(problem, settings, SweepOn(problem));
  if (again.rms < found.rms) return again;
  std::swap(swept_, before_);
  return found;
}

// Whether what was found is no answer of a small island, or no way to one of a big island. Quick effort takes what it gets.
bool IslandSolver::IsLost(const Problem& problem, const Settings& settings, const NaturalMap& map) const {
  if (!MayBeRough(problem, settings))
    return !map.Meets(settings.tolerance * settings.velocity_scale) || !IsUseful(problem, settings);
  return settings.effort.sweeps >= kNormalEffort.sweeps && map.rms > kLostRms * settings.velocity_scale;
}

// Sweeps carry loads slowly: from a heavy body through light ones, or down a tower of hundreds, they do not get to the ground. What
// the convex problem without slips says is nearer then. Where it has no solution, and nothing sensible was found before, that is the
// answer of small islands: it tells which bounces are to blame. Returns whether it is.
bool IslandSolver::SolveFromConvex(const Problem& problem, const Settings& settings, NaturalMap* map,
                                   Solution* solution) {
  RunInteriorPoint(problem, settings, {}, &trial_);
  const bool useful = std::isfinite(map->rms) && IsUseful(problem, settings);
  if (trial_.status == Status::kInfeasible || trial_.status == Status::kFailed) {
    const bool sensible = useful && (!IsSmall(problem) || map->rms <= kLostRms * settings.velocity_scale);
    if (!sensible) *solution = trial_;
    return !sensible;
  }
  std::swap(swept_, before_);
  swept_.impulses = trial_.impulses, swept_.velocities = trial_.velocities;
  const NaturalMap found = Improve(problem, settings, MapOfSwept(problem));
  if (useful && map->rms <= found.rms) {
    std::swap(swept_, before_);
  } else {
    *map = found;
    solution->rung = Rung::kInteriorPoint;
  }
  return false;
}

// Sweeps of big islands, and Newton's method, from the impulses at hand and their map. Returns the map of what they made of them.
NaturalMap IslandSolver::Improve(const Problem& problem, const Settings& settings, NaturalMap map) {
  const bool small = IsSmall(problem);
  const double goal = settings.tolerance * settings.velocity_scale;
  const bool rough = !small || (MayBeRough(problem, settings) && !AllZero(swept_.impulses));
  if (rough) map = Search(problem, settings, map);
  const bool exact = (small || HasFewLoops(problem)) && (!rough || IsUncarried(problem, settings, map));
  if (exact || (settings.effort.newton && !map.Meets(goal))) {
    const CoulombNewton::Aim aim = {goal, exact ? kSmallShare * goal : goal, settings.speed_share};
    coulomb_newton_.Solve(problem, scales_, aim, exact ? kNewtonSteps : kBigNewtonSteps, &swept_.impulses);
    iterations_ += coulomb_newton_.factorisations();
  }
  VelocitiesAfter(problem, swept_.impulses, &swept_.velocities);  // without the rounding of thousands of increments
  return MapOfSwept(problem);
}

// Whether sweeps may do. A small island is exact, unless it may move inexactly.
bool IslandSolver::MayBeRough(const Problem& problem, const Settings& settings) {
  return !IsSmall(problem) || (settings.speed_share > 0 && problem.num_bodies() > kTinyIsland);
}

// Whether sweeps did not do: what is to stand, or what they do not carry from one end to the other, wants more.
bool IslandSolver::IsUncarried(const Problem& problem, const Settings& settings, const NaturalMap& map) const {
  return map.rms > kCarried * settings.velocity_scale ||
         ContactSpeed(problem, swept_.velocities.data()) <= kStill * settings.velocity_scale;
}

// Big islands: up to the goal or the effort.
NaturalMap IslandSolver::Search(const Problem& problem, const Settings& settings, NaturalMap best) {
  const double goal = settings.tolerance * settings.velocity_scale;
  PrepareSweeps(problem);
  best_ = swept_;
  const bool single = problem.num_bodies() >= kSingleBodies && MassRatio(problem) <= kSingleMasses;
  bool astray = false;
  for (int left = settings.effort.sweeps; left > 0 && !best.Meets(goal);) {
    const Precision precision =
        single && best.rms > kSingleAbove * settings.velocity_scale ? Precision::kSingle : Precision::kDouble;
    const int block = std::min(left, astray ? kPlainSweeps : kSweeps);
    left -= block;
    gauss_seidel_.Sweep(problem, block, 0.1 * goal, &swept_.impulses, &swept_.velocities,
                        astray ? Pace::kPlain : Pace::kMomentum, precision);
    const NaturalMap now = MapOfSwept(problem);
    astray = !astray && now.rms > kBlockGain * best.rms;
    if (now.rms < best.rms) best = now, best_ = swept_;
  }
  std::swap(swept_, best_);
  return best;
}

// Each round asks whether the slips that its problem assumed are those of its answer. The rounds before the last one need not be
// accurate: they only place the slips. The first has none, so that an island in which nothing slides gets the one answer of the
// convex problem.
void IslandSolver::SolveOctagon(const Problem& problem, const Settings& settings, Solution* solution) {
  const double goal = settings.tolerance * settings.velocity_scale;
  const int rounds = std::max(1, settings.effort.sweeps / kSweepsOfASolve);
  const bool small = IsSmall(problem);
  slips_.assign(problem.contacts.size(), 0.0);
  Settings inner = settings;
  bool accurate = small, answered = false, settled = false;
  for (int round = 1; round <= rounds && !(settled && answered); ++round) {
    accurate = accurate || round == rounds;
    inner.tolerance = accurate ? settings.tolerance : std::max(settings.tolerance, kRoughTolerance);
    RunInteriorPoint(problem, inner, slips_, &trial_);
    const bool solved = trial_.status == Status::kSolved || trial_.status == Status::kInaccurate;
    if (!solved && answered) break;
    if (!solved || accurate) *solution = trial_, answered = true;
    if (!solved) return;
    swept_.impulses = trial_.impulses, swept_.velocities = trial_.velocities;
    settled = UpdateSlips(problem, settings.cone) <= goal;
    accurate = small || settled;  // a rough round places the slips, but is no answer
  }
  if (!settled && solution->status == Status::kSolved) solution->status = Status::kInaccurate;
}

// Slips of the swept velocities; returns the largest change. Also where nothing presses: with s = 0 the convex problem
// would push such a contact open to u_n = mu |u_t|.
double IslandSolver::UpdateSlips(const Problem& problem, Cone cone) {
  double change = 0;
  for (size_t c = 0; c < slips_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3 u = ContactVelocity(contact, swept_.velocities.data()) + contact.compliance * swept_.impulses[c];
    const double slip = Slip(u, contact.friction, cone);
    change = std::max(change, std::abs(slip - slips_[c]));
    slips_[c] = slip;
  }
  return change;
}

}  // namespace islet::qp
