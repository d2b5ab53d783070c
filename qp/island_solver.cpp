#include "qp/island_solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/octagon_contact.h"
#include "qp/one_contact.h"
#include "qp/slip.h"

namespace islet::qp {
namespace {

constexpr double kGuessShare = 0.5;  // of the natural map of no impulses: what a guess must reach to be of use
constexpr double kWildShare = 30;    // of the same: what it must not exceed before it is mended
constexpr int kMendingSweeps = 20;
constexpr double kHeldShare = 1e-3;     // of the tolerance: what held before must meet, frame after frame
constexpr double kRoundingGap = 1e-11;  // what rounding may leave of a gap
constexpr double kColumnShare = 0.1;    // of what held must meet: what slides or turns in a column
constexpr double kNormalShare = 1e-2;   // of the tolerance: natural map without friction, by Newton's method
constexpr int kNormalFactorisations = 6;
constexpr double kNormalStart = 1e-5;  // of v_ref: natural map (rms) of sweeps from which Newton's method gets there
constexpr int kNormalSweeps = 40;      // before an interior point that starts from them
// Of it: where a linear step begins, and where sweeps do, which are slow.
constexpr double kStickShare = 0.1, kSweptShare = 1e-2;
constexpr int kHeldBlocks = 3, kHeldSweeps = 10;

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
  solution->rounds = 0;
  solution->gap = 0;
  solution->coulomb_reached = true;
  solution->status = Status::kSolved;
  solution->multipliers.clear();
  solution->bounce_multipliers.clear();
  solution->slips.assign(problem.contacts.size(), 0.0);
  solution->impulses.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &solution->velocities);
}

}  // namespace

double IslandSolver::AtThisPace(double before, double now, int blocks) { return now * std::pow(now / before, blocks); }

double IslandSolver::Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

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
  } else if (settings.ladder.Has(Rung::kClosedForm) && SolveOneBody(problem, settings, solution)) {
    solution->rung = Rung::kClosedForm;
  } else {
    Climb(problem, settings, start, solution);
  }
  solution->iterations = iterations_;
  solution->in_vain = in_vain_;
  if (!AllFinite(*solution)) solution->status = Status::kFailed;
}

// One body, contacts with walls that all stick or do not press.
bool IslandSolver::SolveOneBody(const Problem& problem, const Settings& settings, Solution* solution) {
  if (!OneBody::Fits(problem)) return false;
  const double begin = Seconds();
  if (one_body_.Solve(problem, settings, solution)) return true;
  in_vain_.Add(Rung::kClosedForm, Seconds() - begin);
  return false;
}

// What no formula for few contacts answers, from columns upwards.
void IslandSolver::Climb(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                         Solution* solution) {
  ImpulseScales(problem, &scales_);
  if (settings.ladder.Has(Rung::kColumn) && SolveColumn(problem, settings, solution)) {
    solution->rung = Rung::kColumn;
  } else if (settings.ladder.Has(Rung::kHeld) && StillHold(problem, settings, start, solution)) {
    solution->rung = Rung::kHeld;
  } else if (settings.ladder.Has(Rung::kPlanar) && SolvePlanar(problem, settings, start, solution)) {
    solution->rung = Rung::kPlanar;
  } else {
    SolveWhole(problem, settings, start, solution);
  }
}

// Nearly a formula: judged like what still holds, by the gap that was asked for, and by the energy: who says which bounces are to
// blame for too much of it is the interior point.
bool IslandSolver::SolveColumn(const Problem& problem, const Settings& settings, Solution* solution) {
  if (AnyCompliance(problem) || !IsConvex(problem, settings)) return false;
  const double begin = Seconds(), goal = kHeldShare * settings.coulomb_tolerance * settings.velocity_scale;
  const double slide = std::min(kColumnTolerance * settings.velocity_scale, kColumnShare * goal);
  if (!column_.Solve(problem, slide, solution->velocities, &swept_impulses_)) return false;
  VelocitiesAfter(problem, swept_impulses_, &swept_velocities_);
  const bool useful =
      KineticEnergy(problem, swept_velocities_.data()) <= (1 + settings.tolerance) * settings.energy_limit;
  if (useful && MapOfSwept(problem).max <= goal && HoldsExactly(problem, settings, solution) &&
      solution->gap <= std::max(kRoundingGap, settings.tolerance))
    return true;
  Prepare(problem, solution);
  in_vain_.Add(Rung::kColumn, Seconds() - begin);
  return false;
}

// In the plane all is measured as in space: each group of contacts has the scale that its contacts have together.
bool IslandSolver::SolvePlanar(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                               Solution* solution) {
  if (settings.cone != Cone::kCircular || AnyCompliance(problem) || !IsConvex(problem, settings) ||
      !planar_.Reduce(problem, settings.velocity_scale))
    return false;
  const double begin = Seconds();
  const InVain before = in_vain_;
  planar_.MergeImpulses(start, &planar_start_);
  whole_scales_.swap(scales_);
  planar_.MergeScales(whole_scales_, &scales_);
  Prepare(planar_.problem(), &planar_solution_);
  in_plane_ = true;
  if (!SolveOneContact(planar_.problem(), settings, &planar_solution_)) {
    Settings inner = settings;
    if (problem.num_bodies() <= kSmallIsland) inner.coulomb_tolerance *= kPlanarShare;
    SolveWhole(planar_.problem(), inner, planar_start_, &planar_solution_);
  }
  in_plane_ = false;
  scales_.swap(whole_scales_);
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  if (planar_solution_.status == Status::kSolved && AllFinite(planar_solution_) &&
      planar_.Expand(problem, planar_solution_, solution) <= kPlanarShare * goal) {
    solution->coulomb_reached =
        solution->coulomb_reached || CoulombMap(problem, solution->velocities, solution->impulses, scales_).rms <= goal;
    return true;
  }
  Prepare(problem, solution);
  in_vain_.Fail(Rung::kPlanar, before, Seconds() - begin);
  return false;
}

// Without a look at symmetry or at the frame before.
void IslandSolver::SolveWhole(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                              Solution* solution) {
  if (AnyFriction(problem) && settings.model == Model::kCoulomb) {
    if (settings.cone != Cone::kCircular || !SolveExact(problem, settings, start, solution))
      SolveCoulomb(problem, settings, solution);
  } else if (AnyFriction(problem) || !settings.ladder.Has(Rung::kNormal) ||
             !SolveNormal(problem, settings, start, solution)) {
    Settings inner = settings;
    if (problem.num_bodies() <= kSmallIsland) inner.aim = kSmallAim;
    RunInteriorPoint(problem, inner, {}, solution);
  }
}

void IslandSolver::RunInteriorPoint(const Problem& problem, const Settings& settings, std::span<const double> slips,
                                    Solution* solution, std::span<const Vector3> near) {
  if (in_plane_) {
    planar_interior_point_.Solve(problem, planar_.weights(), settings, slips, solution, near);
  } else {
    interior_point_.Solve(problem, settings, slips, solution, near);
  }
  iterations_ += solution->iterations;
  solution->rung = Rung::kInteriorPoint;
}

bool IslandSolver::SolveOneContact(const Problem& problem, const Settings& settings, Solution* solution) {
  if (problem.contacts.size() != 1 || problem.contacts[0].compliance > 0) return false;
  const double begin = Seconds();
  const ContactTerm& contact = problem.contacts[0];
  Matrix3 w = DelassusBlock(problem, contact);
  if (w(2, 2) == 0) w(2, 2) = w(1, 1);  // in the plane nothing moves along the second tangent
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

// Whether the impulses of the frame before meet the law as they are: to much more than the tolerance, since the same may be
// asked for thousands of frames. A tower under constant impulses is unstable and leans by twice as much a frame: one linear step
// takes that back, or a few sweeps where something is about to slide; there the models differ, and only the exact law is served.
bool IslandSolver::StillHold(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                             Solution* solution) {
  if (start.size() != problem.contacts.size() || AnyCompliance(problem) || settings.cone != Cone::kCircular ||
      !IsConvex(problem, settings) || AllZero(start))
    return false;
  TakeOver(problem, start);
  const double scale = settings.coulomb_tolerance * settings.velocity_scale, goal = kHeldShare * scale;
  const double map = MapOfSwept(problem).max;
  if (!(map <= scale)) return false;
  const bool sticks = StickingStep::Fits(problem, swept_impulses_);
  const bool sweeps = !sticks && map > kSweptShare * goal, steps = sticks && map > kStickShare * goal;
  const double begin = Seconds();
  if (steps) sticking_step_.Take(problem, scales_, 0.1 * kStickShare * goal, &swept_impulses_, &swept_velocities_);
  if (sweeps) SweepHeld(problem, goal, map);
  const double reached = steps || sweeps ? MapOfSwept(problem).max : map;
  if (reached <= goal && HoldsExactly(problem, settings, solution)) return true;
  in_vain_.Add(Rung::kHeld, Seconds() - begin);
  return false;
}

// Whether the swept impulses, whose map is small enough, have a small gap, too, and in other models than exact Coulomb's no slip.
bool IslandSolver::HoldsExactly(const Problem& problem, const Settings& settings, Solution* solution) {
  const double goal = kHeldShare * settings.coulomb_tolerance * settings.velocity_scale;
  if (!TakeSwept(problem, settings, kHeldShare, solution)) return false;
  if (settings.model == Model::kCoulomb) return true;
  const double slip = *std::max_element(solution->slips.begin(), solution->slips.end());
  std::fill(solution->slips.begin(), solution->slips.end(), 0.0);
  return slip <= goal;
}

// A few sweeps of what TakeOver has and whose natural map [velocity] is given; given up where their pace does not lead to `goal`.
void IslandSolver::SweepHeld(const Problem& problem, double goal, double map) {
  gauss_seidel_.Prepare(problem);
  for (int left = kHeldBlocks; left > 0; --left) {
    const double before = map;
    const int sweeps =
        gauss_seidel_.Sweep(problem, kHeldSweeps, 0.1 * kSweptShare * goal, &swept_impulses_, &swept_velocities_);
    map = MapOfSwept(problem).max;
    if (sweeps < kHeldSweeps || AtThisPace(before, map, left - 1) > goal) break;
  }
  VelocitiesAfter(problem, swept_impulses_, &swept_velocities_);
}

// Takes the answer of the sweeps if it meets the exact law by itself, to `share` of the tolerance.
bool IslandSolver::AcceptSweeps(const Problem& problem, const Settings& settings, double share, Solution* solution) {
  return MapOfSwept(problem).max <= share * settings.coulomb_tolerance * settings.velocity_scale &&
         TakeExact(problem, settings, share, solution);
}

// Takes swept impulses with velocities without the rounding of thousands of increments, unless their gap is too large.
bool IslandSolver::TakeExact(const Problem& problem, const Settings& settings, double share, Solution* solution) {
  VelocitiesAfter(problem, swept_impulses_, &swept_velocities_);
  return TakeSwept(problem, settings, share, solution);
}

// Takes impulses, and velocities that must be exactly those that they make, unless their gap is too large. A contact's slip gives
// way by as much as it approaches faster than it may: with these slips the answer is feasible.
bool IslandSolver::TakeSwept(const Problem& problem, const Settings& settings, double share, Solution* solution) {
  double gap = 0, energy = 0;
  swept_slips_.resize(problem.contacts.size());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3& j = swept_impulses_[c];
    Vector3 u = ContactVelocity(contact, swept_velocities_.data()) + contact.compliance * j;
    u[0] -= contact.target;
    swept_slips_[c] = Slip(u, contact.friction, Cone::kCircular);
    swept_slips_[c] += std::max(0.0, -u[0]);
    u[0] += swept_slips_[c];
    gap += std::abs(j.dot(u));
  }
  const double scale = settings.velocity_scale;
  for (const BodyTerm& body : problem.bodies)
    energy += 0.5 * body.mass * (body.velocity.head<3>().squaredNorm() + scale * scale);
  if (gap > share * settings.coulomb_tolerance * energy) return false;
  solution->impulses = swept_impulses_;
  solution->velocities = swept_velocities_;
  solution->slips = swept_slips_;
  solution->gap = gap / energy;
  solution->status = Status::kSolved;
  solution->rung = Rung::kSweeps;
  return true;
}

// No contact has friction. False where there is no answer (bounces that contradict each other, walls that close on a body), or
// none that these methods find.
bool IslandSolver::SolveNormal(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                               Solution* solution) {
  if (AnyCompliance(problem) || !IsConvex(problem, settings)) return false;
  const double begin = Seconds(), goal = kNormalShare * settings.coulomb_tolerance * settings.velocity_scale;
  const bool big = problem.num_bodies() > kSmallIsland && !in_plane_;
  gauss_seidel_.Prepare(problem);
  // As it is where an interior point follows: that survives what is wild, and judging it costs as much as a dozen sweeps.
  if (big && start.size() == problem.contacts.size()) {
    TakeOver(problem, start);
  } else {
    StartFrom(problem, start);
  }
  gauss_seidel_.Sweep(problem, big ? kNormalSweeps : kSweeps, goal, &swept_impulses_, &swept_velocities_,
                      Pace::kMomentum);
  const double map = MapOfSwept(problem).rms;
  bool solved = false;
  if (map <= kNormalStart * settings.velocity_scale) {
    solution->impulses = swept_impulses_;
    solved = normal_newton_.Solve(problem, goal, kNormalFactorisations, &solution->impulses);
    iterations_ += normal_newton_.factorisations();
  }
  if (!solved && big) {
    solution->impulses = swept_impulses_;
    solved = normal_interior_point_.Solve(problem, settings, map, swept_velocities_, &solution->impulses);
    iterations_ += normal_interior_point_.factorisations();
    solution->gap = normal_interior_point_.gap();
  }
  if (!solved) {
    solution->gap = 0;
    solution->impulses.assign(problem.contacts.size(), Vector3::Zero());
    in_vain_.Add(Rung::kNormal, Seconds() - begin);
    return false;
  }
  VelocitiesAfter(problem, solution->impulses, &solution->velocities);
  solution->rung = Rung::kNormal;
  return true;
}

// The caller's impulses, one per contact, inside the cones.
void IslandSolver::TakeOver(const Problem& problem, std::span<const Vector3> start) {
  swept_impulses_.resize(start.size());
  for (size_t c = 0; c < start.size(); ++c)
    swept_impulses_[c] = ProjectOnCircularCone(start[c], problem.contacts[c].friction);
  VelocitiesAfter(problem, swept_impulses_, &swept_velocities_);
}

// Takes over impulses from the caller, or none if those are of no use. Of thousands a few dozen do not fit, since contacts came
// and went, and make the whole worse than none: a few sweeps of the problem that was prepared last mend that. Returns whether
// they are of use.
bool IslandSolver::StartFrom(const Problem& problem, std::span<const Vector3> start) {
  swept_impulses_.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &swept_velocities_);
  if (start.size() != problem.contacts.size() || AllZero(start)) return false;
  const double without = MapOfSwept(problem).rms;
  TakeOver(problem, start);
  if (MapOfSwept(problem).rms < kWildShare * without) {
    gauss_seidel_.Sweep(problem, kMendingSweeps, 0, &swept_impulses_, &swept_velocities_, Pace::kMomentum);
    if (MapOfSwept(problem).rms < kGuessShare * without) return true;
  }
  swept_impulses_.assign(problem.contacts.size(), Vector3::Zero());
  CopyFreeVelocities(problem, &swept_velocities_);
  return false;
}

NaturalMap IslandSolver::MapOfSwept(const Problem& problem) const {
  return CoulombMap(problem, swept_velocities_, swept_impulses_, scales_);
}

}  // namespace islet::qp
