#include "qp/cascade/island_solver.h"

#include <algorithm>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/direct/octagon_contact.h"
#include "qp/direct/one_contact.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

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

}  // namespace

constexpr IslandSolver::Strategy IslandSolver::kStrategies[] = {
    {Rung::kClosedForm, &IslandSolver::IsOneContact, &IslandSolver::SolveOneContact},
    {Rung::kColumn, &IslandSolver::IsColumn, &IslandSolver::SolveColumn},
    {Rung::kHeld, &IslandSolver::StillHolds, &IslandSolver::Hold},
    {Rung::kInteriorPoint, &IslandSolver::HasExactFriction, &IslandSolver::SolveExactFriction},
    {Rung::kInteriorPoint, &IslandSolver::IsOctagon, &IslandSolver::SolveOctagon},
    {Rung::kInteriorPoint, &IslandSolver::Always, &IslandSolver::SolveConvex},
};

void IslandSolver::Solve(const Problem& problem, const Settings& settings, Solution* solution,
                         std::span<const Vector3> start) {
  ReturnNone(problem, solution);
  solution->rung = Rung::kNothing;
  solution->iterations = 0;
  convex_.Begin();
  scales_.clear();
  tried_ = false;
  const Task task{problem, settings, start, scales_};
  for (const Strategy& strategy : kStrategies) {
    if (problem.contacts.empty()) break;
    if (strategy.rung != Rung::kInteriorPoint && !settings.ladder.Has(strategy.rung)) continue;
    if (strategy.rung > Rung::kClosedForm && scales_.empty()) ImpulseScales(problem, &scales_);
    if (!(this->*strategy.fits)(task)) continue;
    solution->rung = strategy.rung;
    if ((this->*strategy.solve)(task, solution)) break;
  }
  if (!AllFinite(*solution)) solution->status = Status::kFailed;
}

bool IslandSolver::IsOneContact(const Task& task) {
  return task.problem.contacts.size() == 1 && task.problem.contacts[0].compliance == 0;
}

bool IslandSolver::SolveOneContact(const Task& task, Solution* solution) {
  const ContactTerm& contact = task.problem.contacts[0];
  const Matrix3 w = DelassusBlock(task.problem, contact);
  const Vector3 u = ContactVelocity(contact, solution->velocities.data());
  double multiplier = 0;
  if (!SolveAlone(w, u, contact, task.settings, &solution->impulses[0], &multiplier)) {
    solution->impulses[0].setZero();
    return false;
  }
  ApplyImpulse(task.problem, contact, solution->impulses[0], solution->velocities.data());
  if (task.coulomb()) {
    const Vector3 after = ContactVelocity(contact, solution->velocities.data());
    solution->slips[0] = Slip(after, contact.friction, task.settings.cone);
  }
  if (!IsConvex(task)) {
    solution->bounce_multipliers = {multiplier};
    solution->multipliers = solution->velocities;
    ApplyImpulse(task.problem, contact, {-multiplier, 0, 0}, solution->multipliers.data());
  }
  return true;
}

bool IslandSolver::IsColumn(const Task& task) {
  if (AnyCompliance(task.problem) || !IsConvex(task)) return false;
  const double slide = std::min(10 * kRefined, 0.1 * kExactShare * task.settings.tolerance) * task.scale();
  CopyFreeVelocities(task.problem, &candidate_.velocities);
  if (!column_.Solve(task.problem, slide, candidate_.velocities, &candidate_.impulses)) return false;
  VelocitiesAfter(task.problem, candidate_.impulses, &candidate_.velocities);
  return true;
}

// Nearly a formula: judged like what still holds.
bool IslandSolver::SolveColumn(const Task& task, Solution* solution) {
  return candidate_.IsUseful(task) && candidate_.ReturnIfExact(task, kExactShare, solution);
}

// Whether the impulses of the frame before meet the law as they are: to much more than the tolerance, since the same may be asked for
// thousands of frames, and a tower under constant impulses leans by twice as much a frame.
bool IslandSolver::StillHolds(const Task& task) {
  if (task.start.size() != task.problem.contacts.size() || AnyCompliance(task.problem) ||
      task.settings.cone != Cone::kCircular || !IsConvex(task) || AllZero(task.start))
    return false;
  candidate_.TakeOver(task.problem, task.start);
  map_of_tried_ = candidate_.MapOf(task);
  tried_ = true;
  return map_of_tried_.max <= 0.1 * kExactShare * task.goal();
}

bool IslandSolver::Hold(const Task& task, Solution* solution) {
  return candidate_.ReturnIfExact(task, 0.1 * kExactShare, solution);
}

bool IslandSolver::SolveExactFriction(const Task& task, Solution* solution) {
  coulomb_search_.Solve(task, tried_ ? &candidate_ : nullptr, map_of_tried_, &convex_, solution);
  solution->iterations = coulomb_search_.factorisations() + convex_.iterations();
  if (!task.coulomb()) std::fill(solution->slips.begin(), solution->slips.end(), 0.0);
  return true;
}

bool IslandSolver::SolveOctagon(const Task& task, Solution* solution) {
  slip_rounds_.Solve(task, &convex_, solution);
  solution->iterations = convex_.iterations();
  return true;
}

bool IslandSolver::SolveConvex(const Task& task, Solution* solution) {
  convex_.Solve(task.problem, task.settings, {}, solution);
  return true;
}

}  // namespace islet::qp
