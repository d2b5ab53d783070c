// Exact Coulomb friction in IslandSolver: which slips and impulses the sweeps find, and what the interior point makes of them.
#include <algorithm>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/island_solver.h"
#include "qp/slip.h"

namespace islet::qp {
namespace {

constexpr int kMaxBlocks = 10;    // of sweeps
constexpr double kEnoughRms = 3;  // times the tolerance: natural map at which the search ends
constexpr double kEnoughMax = 30;
constexpr int kRestIterations = 14;   // resting islands take 9 to 12
constexpr double kRestShare = 0.1;    // of the tolerance: what rests for long is held to more than is asked for
constexpr int kPlaneIterations = 40;  // in the plane an iteration costs little more than a sweep
constexpr double kLostRms = 1e-2;     // of v_ref: natural map of sweeps that have lost their way (in jams: below 4e-3)
constexpr double kBlockGain = 0.7;    // of the natural map, for another block
constexpr double kFewLeft = 0.5;      // worst contact's share of the natural map's norm: few are left, and may drift
constexpr int kDriftBlocks = 2;       // without a gain, while so few are left
constexpr double kLeastDrift = 1e-3;  // of the tolerance
// Sweeps of single precision take 0.6 of the time, and end at a natural map of 1e-5 to 6e-5 of v_ref.
constexpr double kSingleMasses = 100;     // largest mass over the least
constexpr double kSingleAbove = 1e-4;     // of v_ref: natural map
constexpr double kTowerShare = 0.6;       // of the contacts, in faces
constexpr double kRoughTolerance = 1e-4;  // of the solves that only feed the sweeps
// Of what the natural map says that the slips of a big island's last problem miss: velocities [root of the gap] need to be no nearer
// to that problem's answer than it is to the law. No more of a gap than this share of coulomb_tolerance.
constexpr double kSlipShare = 0.7;
constexpr double kMostGap = 0.1;

// Small islands, by Newton's method.
constexpr int kStartBlocks = 4, kStartSweeps = 25;  // from the impulses of the frame before
constexpr double kStartGain = 0.5;                  // of the natural map, for another block
constexpr double kNewtonShare = 1e-3;               // of the tolerance: what is sought; in the plane all of it, since that is less
constexpr int kNewtonSteps = 150;                   // factorisations

double MassRatio(const Problem& problem) {
  const auto lighter = [](const BodyTerm& a, const BodyTerm& b) { return a.mass < b.mass; };
  const auto [least, most] = std::minmax_element(problem.bodies.begin(), problem.bodies.end(), lighter);
  return most->mass / least->mass;
}

double LargestFriction(const Problem& problem) {
  double largest = 0;
  for (const ContactTerm& contact : problem.contacts) largest = std::max(largest, contact.friction);
  return largest;
}

}  // namespace

// More than `most` bodies that lie on each other's faces: sweeps carry a load from contact to contact of a face, and take long. In
// cubejam and three dropped stacks 202 of 258 tries (of 200 sweeps) on five bodies and more ended in vain, 210 of 378 on three and four;
// where faces have fewer of the contacts, 568 of 1,530 and 107 of 1,020. A face: neighbours in the order of the contacts; all
// walls count as one body.
bool IslandSolver::IsTower(const Problem& problem, int most) {
  if (problem.num_bodies() <= most) return false;
  const std::vector<ContactTerm>& contacts = problem.contacts;
  size_t in_faces = 0;
  for (size_t first = 0, end; first < contacts.size(); first = end) {
    for (end = first + 1; end < contacts.size() && contacts[end].body_a == contacts[first].body_a &&
                          contacts[end].body_b == contacts[first].body_b;)
      ++end;
    if (end - first >= 3) in_faces += end - first;
  }
  return static_cast<double>(in_faces) > kTowerShare * static_cast<double>(contacts.size());
}

// Where hardly anything slides the convex problem without slips is all but the answer, and sweeps find the rest; elsewhere
// the sweeps start from the impulses at hand. What they leave over is the friction of contacts on the edge of sliding: the
// convex problem with the slips found is solved as exactly as these are worth it, where the sweeps have not done that, so that all but those slips
// is exact.
void IslandSolver::SolveBigCoulomb(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                                   Solution* solution) {
  slips_.assign(problem.contacts.size(), 0.0);
  gauss_seidel_.Prepare(problem);
  StartFrom(problem, start);
  const bool certified = settings.tier == Tier::kCertified;
  if (certified && (settings.expect_rest || in_plane_)) {
    Settings brief = settings;
    brief.max_iterations = in_plane_ ? kPlaneIterations : kRestIterations;
    brief.tolerance *= kRestShare;
    if (in_plane_) brief.aim = kSmallAim;
    RunInteriorPoint(problem, brief, slips_, &trial_);
    if (trial_.status == Status::kSolved) swept_impulses_ = trial_.impulses, swept_velocities_ = trial_.velocities;
  }
  NaturalMap map = Search(problem, settings);
  if (certified && map.rms > kLostRms * settings.velocity_scale) map = SearchFromConvex(problem, settings, map);
  // The interior point's velocities are good to the root of its gap, too.
  const double near = std::max(std::sqrt(settings.tolerance), kAcceptShare * settings.coulomb_tolerance);
  bool accepted = !certified || map.rms <= near * settings.velocity_scale;
  if (accepted) {
    VelocitiesAfter(problem, swept_impulses_, &swept_velocities_);
    accepted = TakeSwept(problem, settings, certified ? kAcceptShare : INFINITY, solution);
  }
  if (!accepted) {
    UpdateSlips(problem, Cone::kCircular);
    Settings last = settings;
    const double share = kSlipShare * std::min(1.0, LargestFriction(problem)) * map.rms / settings.velocity_scale;
    last.tolerance = std::clamp(share * share, settings.tolerance,
                                std::max(settings.tolerance, kMostGap * settings.coulomb_tolerance));
    RunInteriorPoint(problem, last, slips_, solution, swept_impulses_);
    solution->rounds = 1;
  }
  solution->coulomb_reached = CoulombMap(problem, solution->velocities, solution->impulses, scales_).rms <=
                              settings.coulomb_tolerance * settings.velocity_scale;
}

// Improves swept_impulses_ and swept_velocities_ by sweeps, as long as that pays. An answer that is to be certified goes on
// until it can be accepted as it is: that is better than what the interior point makes of it, and cheaper. Returns their map.
NaturalMap IslandSolver::Search(const Problem& problem, const Settings& settings) {
  const bool certified = settings.tier == Tier::kCertified;
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  NaturalMap best = MapOfSwept(problem);
  best_impulses_ = swept_impulses_, best_velocities_ = swept_velocities_;
  const auto enough = [&](const NaturalMap& map) {
    return map.max <= kAcceptShare * goal ||
           (!certified && map.rms <= kEnoughRms * goal && map.max <= kEnoughMax * goal);
  };
  const bool single = problem.num_bodies() >= kSingleBodies && MassRatio(problem) <= kSingleMasses;
  bool few = false;
  int missed = 0;
  for (int block = 0; block < kMaxBlocks && missed < (few ? kDriftBlocks : 1) && !enough(best); ++block) {
    if (few) drift_.Follow(problem, scales_, kLeastDrift * goal, &gauss_seidel_, &swept_impulses_, &swept_velocities_);
    const Precision precision =
        single && best.rms > kSingleAbove * settings.velocity_scale ? Precision::kSingle : Precision::kDouble;
    gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_, Pace::kMomentum, precision);
    const NaturalMap now = MapOfSwept(problem);
    few = now.max > kFewLeft * now.rms * std::sqrt(problem.num_contacts());
    missed = now.rms < kBlockGain * best.rms ? 0 : missed + 1;
    if (now.rms < best.rms) {
      best = now;
      best_impulses_ = swept_impulses_, best_velocities_ = swept_velocities_;
    }
  }
  swept_impulses_.swap(best_impulses_), swept_velocities_.swap(best_velocities_);
  return best;
}

// Sweeps carry loads slowly: in a tower of hundreds they do not get to the ground. What the convex problem without slips
// says is nearer then, if it has a solution.
NaturalMap IslandSolver::SearchFromConvex(const Problem& problem, const Settings& settings, const NaturalMap& swept) {
  std::fill(slips_.begin(), slips_.end(), 0.0);
  RunInteriorPoint(problem, settings, slips_, &trial_);
  if (trial_.status != Status::kSolved ||
      CoulombMap(problem, trial_.velocities, trial_.impulses, scales_).rms > swept.rms)
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
  const double goal = in_plane_ ? enough : kNewtonShare * enough;
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
  const bool small = problem.num_bodies() <= settings.small_island;
  Settings inner = settings;
  if (small) inner.aim = kSmallAim;
  double best = INFINITY;
  bool accurate = small;
  int round = 1;
  for (;; ++round) {
    accurate = accurate || round >= settings.coulomb_rounds || iterations_ >= settings.patience;
    inner.tolerance = accurate ? settings.tolerance : std::max(settings.tolerance, kRoughTolerance);
    const bool near = !small && circular && round > 1;  // to what the last sweeps found, as in SolveBigCoulomb
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
