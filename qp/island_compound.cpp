// Bodies that move as one in IslandSolver: the problem of the compounds, solved by the rungs above, and what its answer is worth.
#include "qp/island_solver.h"

namespace islet::qp {
namespace {

// Of a reduced problem. In stacks of ten dropped from 30 heights rungs in vain (but for sweeps between rounds) took 1.3, 1.3, 1.2, 1.0
// and 1.0 % of the time with 10, 15, 20, 30 and 60 factorisations. A first round runs to its end.
constexpr int kRounds = 1, kPatience = 30;
constexpr double kReducedShare = 0.5;  // of the tolerance, of a reduced problem
constexpr int kSplits = 2;  // of clusters that do not hold; of what two do not serve a third serves one in ten

}  // namespace

bool IslandSolver::MayCompound(const Settings& settings) {
  return settings.ladder.Has(Rung::kCompound) && settings.model == Model::kCoulomb &&
         settings.cone == Cone::kCircular;
}

bool IslandSolver::SolveCompound(const Problem& problem, const Settings& settings, std::span<const Vector3> start,
                                 Solution* solution) {
  if (start.size() != problem.contacts.size() || !MayCompound(settings)) return false;
  const double begin = Seconds();
  const InVain before = in_vain_;
  const double goal = settings.coulomb_tolerance * settings.velocity_scale;
  TakeOver(problem, start);
  if (!compounds_.Find(problem, swept_impulses_, swept_velocities_, settings.velocity_scale)) return false;
  bool expands = false;
  for (int split = 0; !expands && split <= kSplits; ++split) {
    if ((split > 0 && !compounds_.Split(problem, start)) || !SolveReduced(settings)) break;
    expands = compounds_.Expand(problem, start, trial_.velocities, trial_.impulses, goal, &swept_impulses_,
                                &swept_velocities_);
  }
  const bool accepted = expands && AcceptSweeps(problem, settings, kAcceptShare, solution);
  iterations_ += compounds_.factorisations();
  if (accepted) return true;
  in_vain_.Fail(Rung::kCompound, before, Seconds() - begin);
  return false;
}

// Into trial_. In a crowd the interior point would take the largest impulses that fit, far from those at hand.
bool IslandSolver::SolveReduced(const Settings& settings) {
  if (!inner_) inner_ = std::make_unique<IslandSolver>();
  const Problem& reduced = compounds_.reduced();
  Settings inner = settings;
  inner.ladder = settings.ladder.Without(Rung::kCompound);
  inner.coulomb_rounds = kRounds;
  inner.patience = kPatience;
  inner.coulomb_tolerance *= kReducedShare;
  inner_->Solve(reduced, inner, &trial_, compounds_.reduced_start());
  iterations_ += trial_.iterations;
  in_vain_.Include(trial_.in_vain);
  ImpulseScales(reduced, &reduced_scales_);
  return CoulombMap(reduced, trial_.velocities, trial_.impulses, reduced_scales_).max <=
         kAcceptShare * settings.coulomb_tolerance * settings.velocity_scale;
}

}  // namespace islet::qp
