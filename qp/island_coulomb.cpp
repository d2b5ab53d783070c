// Exact Coulomb friction in IslandSolver: which slips and impulses the sweeps find, and what the interior point makes of them.
#include <algorithm>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/island_solver.h"
#include "qp/slip.h"

namespace islet::qp {
namespace {

constexpr int kSmallRounds = 5;   // times the cap on rounds, where they cost microseconds
constexpr int kMaxBlocks = 10;    // of sweeps
constexpr double kEnoughRms = 3;  // times the tolerance: natural map at which the search ends
constexpr double kEnoughMax = 30;
constexpr int kRestIterations = 14;   // resting islands take 9 to 12
constexpr double kRestShare = 0.1;    // of the tolerance: what rests for long is held to more than is asked for
constexpr int kPlaneIterations = 40;  // in the plane an iteration costs little more than a sweep
constexpr double kSprawl = 10;        // times mass times v_ref: impulses that may be larger than they need to
constexpr double kLostRms = 1e-2;     // of v_ref: natural map of sweeps that have lost their way (in jams: below 4e-3)
constexpr double kBlockGain = 0.7;    // of the natural map, for another block
constexpr double kFewLeft = 0.5;      // worst contact's share of the natural map's norm: few are left, and may drift
constexpr int kDriftBlocks = 2;       // without a gain, while so few are left
constexpr double kLeastDrift = 1e-3;  // of the tolerance
// Sweeps of single precision take 0.6 of the time, and end at a natural map of 1e-5 to 6e-5 of v_ref.
constexpr double kSingleMasses = 100;     // largest mass over the least
constexpr double kSingleAbove = 1e-4;     // of v_ref: natural map
constexpr double kRoughTolerance = 1e-4;  // of the solves that only feed the sweeps
// Of what the natural map says that the slips of a big island's last problem miss: velocities [root of the gap] need to be no nearer
// to that problem's answer than it is to the law. No more of a gap than this share of coulomb_tolerance.
constexpr double kSlipShare = 0.7;
constexpr double kMostGap = 0.1;
// Rounds of small islands whose slips come from the rounds before alone.
constexpr int kLeastMixed = 4;    // bodies: among fewer, sweeps carry every load and cost less than another round
constexpr int kSweepsAfter = 30;  // a round that gained little
constexpr int kMixedRounds = 10;
constexpr double kMixedGain = 0.7;    // of the natural map, for another one; it may be missed once
constexpr double kMixedShare = 0.03;  // of the natural map: what the next round's answer may miss of its own problem
constexpr double kMixedAim = 1e-6;    // and at most so much [gap]

// Sweeps of small islands, from the impulses of the frame before or from the answer without slips.
constexpr int kSettleBlocks = 16, kSettleSweeps = 25;
constexpr double kWarmMap = 1e-2;    // of v_ref: from farther away sweeps take as long as all else
constexpr double kTowerShare = 0.6;  // of the contacts, in faces
constexpr int kPartOfTower =
    2;  // as kTower, where patience may end: of 35 tries on three and four parts all were in vain
constexpr double kSettleGain = 0.9;  // of the natural map, for another block
constexpr double kWarmShare = 1e-2;  // of the tolerance, which all else undercuts there by more

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

// Between a floor and a ceiling impulses can grow without bound and do nothing; the interior point goes to where they are
// largest.
bool Sprawls(const Problem& problem, const Settings& settings, const Solution& solution) {
  double mass = 0, pressed = 0;
  for (const BodyTerm& body : problem.bodies) mass += body.mass;
  for (const Vector3& j : solution.impulses) pressed += j[0];
  return pressed > kSprawl * mass * settings.velocity_scale;
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

// Each round asks whether the slips that its problem assumed are those of its answer. The rounds before the last one
// need not be accurate: they only place the sweeps, which find the slips of the next. The best answer of all rounds that
// were solved to the tolerance is returned. The first round has no slips, so that an island in which nothing slides gets the
// one answer of the convex problem, whatever the order of its contacts, unless it starts from the frame before. On small islands
// plain sweeps may end the rounds, which stay near that answer; else the next slips are mixed from those of the rounds before as
// long as that brings the answer nearer, which depends on no order either, and sweeps with momentum are for where it does not.
void IslandSolver::SolveCoulomb(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                                Solution* solution) {
  const bool circular = settings.cone == Cone::kCircular;
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  slips_.assign(problem.contacts.size(), 0.0);
  if (circular) gauss_seidel_.Prepare(problem);
  const bool small = problem.num_bodies() <= settings.small_island;
  if (small && circular && SettlesWarm(problem, settings, start, solution)) return;
  Settings inner = settings;
  if (small) inner.aim = kSmallAim;
  double best = INFINITY;
  bool accurate = small || settings.patience < std::numeric_limits<int>::max();
  int cap = settings.coulomb_rounds * (small ? kSmallRounds : 1), sweeps_from = 1;
  const bool heap = !in_plane_ && !IsTower(problem, 0);  // where sweeps get far
  MixedRounds mixed{.goes_on = small && circular && problem.num_bodies() >= kLeastMixed};
  if (mixed.goes_on) mixing_.Begin(slips_.size());
  int round = 1;
  for (;; ++round) {
    accurate = accurate || round >= cap;
    inner.tolerance = accurate ? settings.tolerance : std::max(settings.tolerance, kRoughTolerance);
    const bool near = !small && circular && round > 1;  // to what the last sweeps found, as in SolveBigCoulomb
    RunInteriorPoint(problem, inner, slips_, &trial_, near ? swept_impulses_ : std::span<const Vector3>());
    const bool fails = trial_.status == Status::kFailed || trial_.status == Status::kInfeasible;
    if (fails && !(mixed.goes_on && mixed.begun)) {
      if (!std::isfinite(best)) *solution = trial_;
      if (round > 1 || !circular || iterations_ >= settings.patience) break;
      FindFirstSlips(problem, goal);
      if (SweepsSuffice(problem, settings, solution)) break;
      continue;
    }
    double map = INFINITY, worst = INFINITY;
    if (!fails) {
      const NaturalMap maps = CoulombMap(problem, trial_.velocities, trial_.impulses, scales_);
      map = maps.rms, worst = maps.max;
      swept_impulses_ = trial_.impulses;
      swept_velocities_ = trial_.velocities;
      if (accurate && (map < best || !circular)) {
        best = map;
        *solution = trial_;
      }
    }
    // Mixed slips get there as near as sweeps must: a round more costs little.
    const bool enough = mixed.goes_on && round > 1 ? worst <= kAcceptShare * goal : best <= goal;
    if (circular && enough) break;
    if (round >= cap || iterations_ >= settings.patience) {
      if (circular && !fails) SettlesAtOnce(problem, settings, heap, worst, solution);
      break;
    }
    if (mixed.goes_on) {
      const bool tries = heap ? !mixed.begun : mixed.begun && GainsLittle(mixed, map);
      if (!fails && tries && SettlesAtOnce(problem, settings, heap, worst, solution)) break;
      if (!mixed.begun) first_.impulses = trial_.impulses, first_.velocities = trial_.velocities;
      mixed.begun = true;  // later than in the first round where that had no answer
      if (MixSlips(problem, settings, round, map, &mixed, &inner.aim)) continue;
      cap += round;  // those of the sweeps are all to come, from the first answer
      swept_impulses_ = first_.impulses;
      swept_velocities_ = first_.velocities;
      sweeps_from = round;
    }
    // Plain sweeps stay near the one answer of the convex problem; where they do not settle, another will do.
    if (circular && round == sweeps_from)
      gauss_seidel_.Sweep(problem, kSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_);
    if (circular && round > sweeps_from) Search(problem, settings);
    const double change = UpdateSlips(problem, settings.cone);
    if (circular && SweepsSuffice(problem, settings, solution)) break;
    const bool settled = !circular && change <= goal;
    if (settled && accurate) break;
    accurate = small || settled;  // a rough round places the slips, but is no answer
  }
  solution->rounds = round;
  if (circular && Sprawls(problem, settings, *solution)) {
    StartFrom(problem, {});
    Search(problem, settings);
    sprawls_ = !AcceptSweeps(problem, settings, in_plane_ ? kAcceptShare / kPlanarShare : kAcceptShare, solution);
    if (!settings.ladder.Has(Rung::kSweeps)) solution->rung = Rung::kInteriorPoint;  // whose answer was mended
  }
  solution->coulomb_reached =
      CoulombMap(problem, solution->velocities, solution->impulses, scales_).rms <= goal || !circular;
}

// From the impulses of the frame before, where something moves: what rests for long is held to more than sweeps reach. They are
// given up as soon as they would take too long at the pace that they show, and not begun on towers.
bool IslandSolver::SettlesWarm(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                               Solution* solution) {
  const bool part = settings.patience < std::numeric_limits<int>::max();
  if (!settings.ladder.Has(Rung::kSweeps) || settings.expect_rest || in_plane_ || AllZero(start) ||
      IsTower(problem, part ? kPartOfTower : kTower))
    return false;
  const double begin = Seconds();
  if (StartFrom(problem, start)) {
    const double map = MapOfSwept(problem).max;
    if (map <= kWarmMap * settings.velocity_scale &&
        SweepsGetThere(problem, settings, kWarmShare, Pace::kMomentum, map, solution))
      return true;
  }
  in_vain_.Add(Rung::kSweeps, Seconds() - begin);
  return false;
}

// Blocks of sweeps from impulses of that natural map [velocity] to a share of the tolerance; given up as soon as they would take
// too long at the pace that they show.
bool IslandSolver::SweepsGetThere(const Problem& problem, const Settings& settings, double share, Pace pace, double map,
                                  Solution* solution) {
  const double goal = share * settings.coulomb_tolerance * settings.velocity_scale;
  for (int left = kSettleBlocks; left > 0; --left) {
    gauss_seidel_.Sweep(problem, kSettleSweeps, 0.1 * goal, &swept_impulses_, &swept_velocities_, pace);
    const double now = MapOfSwept(problem).max;
    if (now <= goal && TakeExact(problem, settings, share, solution)) return true;
    if (now >= kSettleGain * map || AtThisPace(map, now, left - 1) >= goal) return false;
    map = now;
  }
  return false;
}

// The answer of the sweeps, where the ladder has that rung, and they meet the law.
bool IslandSolver::SweepsSuffice(const Problem& problem, const Settings& settings, Solution* solution) {
  return settings.ladder.Has(Rung::kSweeps) && AcceptSweeps(problem, settings, kAcceptShare, solution);
}

// In most loose heaps sweeps from the answer without slips find the one with them, in a tenth of the time of the rounds. They are
// plain: those with momentum get there more often, but where depends on the order of the contacts. On faces sweeps seldom do, but
// go on where the interior point's own accuracy keeps it. map: [velocity] of trial_'s answer, at any contact. Where
// they fail, all is as before.
bool IslandSolver::SettlesAtOnce(const Problem& problem, const Settings& settings, bool heap, double map,
                                 Solution* solution) {
  if (!settings.ladder.Has(Rung::kSweeps)) return false;
  const double begin = Seconds();
  if (heap) {
    if (SweepsGetThere(problem, settings, kAcceptShare, Pace::kPlain, map, solution)) return true;
  } else {
    const double goal = settings.coulomb_tolerance * settings.velocity_scale;
    gauss_seidel_.Sweep(problem, kSweepsAfter, 0.1 * goal, &swept_impulses_, &swept_velocities_);
    if (SweepsSuffice(problem, settings, solution)) return true;
  }
  swept_impulses_ = trial_.impulses;
  swept_velocities_ = trial_.velocities;
  in_vain_.Add(Rung::kSweeps, Seconds() - begin, 0);
  return false;
}

bool IslandSolver::GainsLittle(const MixedRounds& mixed, double map) { return map > kMixedGain * mixed.before; }

// Slips for the next round, and the gap to which it is solved; or false, where mixing gains too little. map: of this round's
// answer, infinite if it has none.
bool IslandSolver::MixSlips(const Problem& problem, const Settings& settings, int round, double map, MixedRounds* mixed,
                            double* aim) {
  mixed->missed += std::isinf(map) ? 2 : GainsLittle(*mixed, map);
  mixed->before = map;
  mixed->goes_on = mixed->missed < 2 && round <= kMixedRounds;
  const double share = kMixedShare * map / settings.velocity_scale;
  *aim = mixed->goes_on ? std::clamp(share * share, kSmallAim, kMixedAim) : kSmallAim;
  if (!mixed->goes_on) return false;
  given_slips_ = slips_;
  UpdateSlips(problem, Cone::kCircular);
  mixing_.Add(given_slips_, slips_);
  mixing_.Next(&slips_);
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
