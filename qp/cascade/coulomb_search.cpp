#include "qp/cascade/coulomb_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "qp/body_algebra.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

// Of v_ref: answers that are farther off have lost their way (in jams: 4e-3), and what is slower stands.
constexpr double kCoarse = 0.01;
// The start.
constexpr double kWildShare = 30;  // of the natural map of no impulses: what it must not exceed before it is mended
constexpr int kSmallSweeps = 60;   // which spare a small island half of its factorisations
// Sweeps.
constexpr int kSweeps = 100;  // a block
constexpr double kRough =
    1e-4;  // of v_ref: natural map. Sweeps that leave more did not get from one end to the other; single precision will do
constexpr int kShortBlock = 20;  // that mends a guess, or leads out of such a circle
// Those of single precision take 0.6 of the time, and end at a natural map of 1e-5 to 6e-5 of v_ref.
constexpr double kSingleMasses = 100;  // largest mass over the least
// Newton's method.
constexpr int kNewtonSteps = 300;   // factorisations of a search; 26 bodies from no impulses take 100 to 200
constexpr int kNewtonBodies = 600;  // times a sweep of the effort: bodies times factorisations
constexpr int kFewLoops = 4;        // of pairs that touch: a factor of such an island is no larger than a tower's
constexpr int kTinyIsland = 8;      // bodies: there Newton's method takes no longer than sweeps

double MassRatio(const Problem& problem) {
  const auto lighter = [](const BodyTerm& a, const BodyTerm& b) { return a.mass < b.mass; };
  const auto [least, most] = std::minmax_element(problem.bodies.begin(), problem.bodies.end(), lighter);
  return most->mass / least->mass;
}

// Whether sweeps may do. A small island is exact, unless it may move inexactly.
bool MayBeRough(const Task& task) {
  return !IsSmall(task.problem) || (task.settings.speed_share > 0 && task.problem.num_bodies() > kTinyIsland);
}

// Whether any contact slides, faster than [m/s].
bool Slides(const Problem& problem, const Candidate& at_hand, double speed) {
  for (size_t c = 0; c < problem.contacts.size(); ++c) {
    const double most = problem.contacts[c].friction * at_hand.impulses[c][0];
    if (most > 0 && OnCone(TangentSize(at_hand.impulses[c]), most) &&
        TangentSize(ContactVelocity(problem.contacts[c], at_hand.velocities.data())) > speed)
      return true;
  }
  return false;
}

// A tower, a bridge.
bool HasFewLoops(const Problem& problem) {
  int pairs = 0, last_a = -1, last_b = -1;
  for (const ContactTerm& c : problem.contacts) {  // in order of pairs
    if (c.body_a < 0 || c.body_b < 0 || (c.body_a == last_a && c.body_b == last_b)) continue;
    last_a = c.body_a;
    last_b = c.body_b;
    ++pairs;
  }
  return pairs < problem.num_bodies() + kFewLoops;
}

int NewtonSteps(const Task& task) {
  const std::int64_t steps = std::int64_t{kNewtonBodies} * task.settings.effort.sweeps / task.problem.num_bodies();
  return static_cast<int>(std::clamp<std::int64_t>(steps, 1, kNewtonSteps));
}

}  // namespace

// From the impulses of the frame before as far as the effort goes; where that has lost its way, or the ladder has no rung for it, from
// the interior point. What stands, and every small island, is improved even where it meets the goal: Newton's method stops where it starts if
// nothing is left to do.
void CoulombSearch::Solve(const Task& task, Candidate* tried, const NaturalMap& map_of_tried, ConvexSolver* convex,
                          Solution* solution) {
  const Problem& problem = task.problem;
  const double goal = task.goal();
  const bool exact = !MayBeRough(task),
             climbs = task.settings.ladder.Has(Rung::kSweeps) || task.settings.ladder.Has(Rung::kNewton);
  solution->rung = Rung::kSweeps;
  prepared_ = answered_ = false;
  factorisations_ = 0;
  NaturalMap map{INFINITY, INFINITY};
  if (climbs) {
    map = Start(task, tried, map_of_tried);
    // Sweeps go from contact to contact, and what they press bodies against each other by on their way stays: flush columns would press their
    // neighbours, and rub on them for ever.
    if (!exact && IsAtRest(task)) map = NewtonOn(task, 0.01 * kExactShare * goal);
    if (IsSmall(problem) || Stands(task) || !map.Meets(goal)) map = Improve(task, map);
    if (!exact && IsLost(task, map)) map = Improve(task, map);  // mostly they find back
    if (exact && !map.Meets(goal)) map = TryAgain(task, map);
    if (!(map.Meets(goal) && Stands(task)) && CanStand(task, convex)) map = Improve(task, now_.MapOf(task));
    if (factorisations_ > 0) solution->rung = Rung::kNewton;
  }
  if ((!climbs || IsLost(task, map)) && SolveFromConvex(task, convex, &map, solution)) return;
  now_.Return(task, solution);
  solution->status = map.Meets(goal) ? Status::kSolved : Status::kInaccurate;
}

// What is at rest, has no impulses to begin with and would fall by the answer at hand stays so where it can: friction has several answers.
// It can where it does on springs: what fits between walls is not squeezed by them. What the convex problem says is an answer of exact friction,
// too, where nothing slides.
bool CoulombSearch::CanStand(const Task& task, ConvexSolver* convex) {
  if (!IsAtRest(task)) return false;
  const bool stands =
      coulomb_newton_.StandsOnSprings(task.problem, task.scales, kCoarse * task.scale(), NewtonSteps(task));
  factorisations_ += coulomb_newton_.factorisations();
  if (!stands) return false;
  SolveWithoutSlips(task, convex);
  if (convex_answer_.status != Status::kSolved) return false;
  std::swap(now_, before_);
  now_.impulses = convex_answer_.impulses, now_.velocities = convex_answer_.velocities;
  if (Stands(task)) return true;
  std::swap(now_, before_);
  return false;
}

// Whether it has no impulses to begin with, and nothing moves but by its weight: a blow is not at rest. before_: without impulses.
bool CoulombSearch::IsAtRest(const Task& task) {
  if (!AllZero(task.start)) return false;
  before_.TakeNone(task.problem);
  return std::none_of(task.problem.contacts.begin(), task.problem.contacts.end(), [&](const ContactTerm& contact) {
    return contact.target > 0 ||
           ContactVelocity(contact, before_.velocities.data()).norm() > (1 + kExact) * task.scale();
  });
}

// Takes over impulses from the caller, or none if those are of no use; returns their map. Of thousands a few dozen do not fit, since
// contacts came and went, and make the whole worse than none: a few sweeps mend that. Those of a small island are not swept: what
// Newton's method finds from there depends on no order of contacts. A small island in which anything slides begins with none, too, unless those
// of before are exact: how contacts share a load is free, and the share of before would turn what slides to one side, step by step.
NaturalMap CoulombSearch::Start(const Task& task, Candidate* tried, const NaturalMap& map_of_tried) {
  const Problem& problem = task.problem;
  double map_of_start = INFINITY;
  if (task.start.size() == problem.contacts.size() && !AllZero(task.start)) {
    if (tried)
      std::swap(now_, *tried);
    else
      now_.TakeOver(problem, task.start);
    const NaturalMap map = tried ? map_of_tried : now_.MapOf(task);
    const bool forgets = !MayBeRough(task) && Slides(problem, now_, kCoarse * task.scale());
    if (map.Meets((forgets ? kExactShare : 1) * task.goal())) return map;
    if (!forgets) map_of_start = map.rms;
    std::swap(now_, before_);
  }
  now_.TakeNone(task.problem);
  const NaturalMap without = now_.MapOf(task);
  if (!(map_of_start < kWildShare * without.rms)) return without;
  std::swap(now_, before_);
  if (IsSmall(problem) && task.settings.speed_share == 0) return now_.MapOf(task);
  const NaturalMap swept = SweepOn(task);
  if (swept.rms < without.rms) return swept;
  std::swap(now_, before_);
  return without;
}

// From what Newton's method left of a small island, by sweeps first. The nearer of both stays.
NaturalMap CoulombSearch::TryAgain(const Task& task, const NaturalMap& found) {
  before_ = now_;
  const NaturalMap again = Improve(task, SweepOn(task));
  if (again.rms < found.rms) return again;
  std::swap(now_, before_);
  return found;
}

// Whether what was found is no answer of a small island, or no way to one of a big island. Quick effort takes what it gets.
bool CoulombSearch::IsLost(const Task& task, const NaturalMap& map) const {
  if (!MayBeRough(task)) return !map.Meets(task.goal()) || !now_.IsUseful(task);
  return task.settings.effort.sweeps >= kNormalEffort.sweeps && map.rms > kCoarse * task.scale();
}

// Both who asks whether it stands and who is lost may want it.
void CoulombSearch::SolveWithoutSlips(const Task& task, ConvexSolver* convex) {
  if (!answered_) convex->Solve(task.problem, task.settings, {}, &convex_answer_);
  answered_ = true;
}

// Sweeps carry loads slowly: from a heavy body through light ones, or down a tower of hundreds, they do not get to the ground. What
// the convex problem without slips says is nearer then. Where it has no solution, and nothing sensible was found before, that is the
// answer of small islands: it tells which bounces are to blame. Returns whether it is.
bool CoulombSearch::SolveFromConvex(const Task& task, ConvexSolver* convex, NaturalMap* map, Solution* solution) {
  const Problem& problem = task.problem;
  SolveWithoutSlips(task, convex);
  const bool useful = std::isfinite(map->rms) && now_.IsUseful(task);
  if (convex_answer_.status == Status::kInfeasible || convex_answer_.status == Status::kFailed) {
    const bool sensible = useful && (!IsSmall(problem) || map->rms <= kCoarse * task.scale());
    if (!sensible) *solution = convex_answer_;
    return !sensible;
  }
  std::swap(now_, before_);
  now_.impulses = convex_answer_.impulses, now_.velocities = convex_answer_.velocities;
  const NaturalMap found = Improve(task, now_.MapOf(task));
  if (useful && map->rms <= found.rms) {
    std::swap(now_, before_);
  } else {
    *map = found;
    solution->rung = Rung::kInteriorPoint;
  }
  return false;
}

// Sweeps of big islands, and Newton's method, from the impulses at hand and their map. Returns the map of what they made of them.
NaturalMap CoulombSearch::Improve(const Task& task, NaturalMap map) {
  const Problem& problem = task.problem;
  const bool small = IsSmall(problem);
  const double goal = task.goal();
  const bool rough = !small || (MayBeRough(task) && !AllZero(now_.impulses));
  if (rough) map = Search(task, map);
  const bool exact = !rough || Stands(task) || ((small || HasFewLoops(problem)) && map.rms > kRough * task.scale());
  if (exact || (task.settings.effort.newton && !map.Meets(goal)))
    return NewtonOn(task, exact ? 0.01 * kExactShare * goal : goal);
  VelocitiesAfter(problem, now_.impulses, &now_.velocities);  // without the rounding of thousands of increments
  return now_.MapOf(task);
}

// By Newton's method from the impulses at hand; least: where it stops. Returns the map of what it made of them.
NaturalMap CoulombSearch::NewtonOn(const Task& task, double least) {
  const CoulombNewton::Aim aim = {task.goal(), least, task.settings.speed_share};
  coulomb_newton_.Solve(task.problem, task.scales, aim, NewtonSteps(task), &now_.impulses);
  factorisations_ += coulomb_newton_.factorisations();
  VelocitiesAfter(task.problem, now_.impulses, &now_.velocities);
  return now_.MapOf(task);
}

// Sweeps leave every contact a velocity that a pile keeps as a pose: walls of bricks would lean, step by step.
bool CoulombSearch::Stands(const Task& task) const {
  return ContactSpeed(task.problem, now_.velocities.data()) <= kCoarse * task.scale();
}

// Big islands: up to the goal or the effort.
NaturalMap CoulombSearch::Search(const Task& task, NaturalMap best) {
  const Problem& problem = task.problem;
  const double goal = task.goal();
  PrepareSweeps(problem);
  best_ = now_;
  const bool single = !IsSmall(problem) && MassRatio(problem) <= kSingleMasses;
  bool astray = false;
  for (int left = task.settings.effort.sweeps; left > 0 && !best.Meets(goal);) {
    const Precision precision = single && best.rms > kRough * task.scale() ? Precision::kSingle : Precision::kDouble;
    const int block = std::min(left, astray ? kShortBlock : kSweeps);
    left -= block;
    gauss_seidel_.Sweep(problem, block, 0.1 * goal, &now_.impulses, &now_.velocities,
                        astray ? Pace::kPlain : Pace::kMomentum, precision);
    const NaturalMap now = now_.MapOf(task);
    astray = !astray && now.rms > best.rms;
    if (now.rms < best.rms) best = now, best_ = now_;
  }
  std::swap(now_, best_);
  return best;
}

void CoulombSearch::PrepareSweeps(const Problem& problem) {
  if (!prepared_) gauss_seidel_.Prepare(problem);
  prepared_ = true;
}

// A few sweeps; most of the way, on a small island.
NaturalMap CoulombSearch::SweepOn(const Task& task) {
  const Problem& problem = task.problem;
  PrepareSweeps(problem);
  const int sweeps = IsSmall(problem) ? kSmallSweeps : kShortBlock;
  gauss_seidel_.Sweep(problem, sweeps, 0, &now_.impulses, &now_.velocities, Pace::kMomentum);
  return now_.MapOf(task);
}

}  // namespace islet::qp
