#include "qp/cascade/slip_rounds.h"

#include <algorithm>
#include <cmath>

#include "qp/slip.h"

namespace islet::qp {
namespace {

constexpr int kSweepsOfASolve = 30;       // what an interior-point solve counts as, of the effort
constexpr double kRoughTolerance = 1e-2;  // of the solves that only place the slips

}  // namespace

// Each round asks whether the slips that its problem assumed are those of its answer. The rounds before the last one need not be
// accurate: they only place the slips. The first has none, so that an island in which nothing slides gets the one answer of the
// convex problem.
void SlipRounds::Solve(const Task& task, ConvexSolver* convex, Solution* solution) {
  const Problem& problem = task.problem;
  const Settings& settings = task.settings;
  const double goal = task.goal();
  const int rounds = std::max(1, settings.effort.sweeps / kSweepsOfASolve);
  const bool small = IsSmall(problem);
  slips_.assign(problem.contacts.size(), 0.0);
  Settings inner = settings;
  bool accurate = small, answered = false, settled = false;
  for (int round = 1; round <= rounds && !(settled && answered); ++round) {
    accurate = accurate || round == rounds;
    inner.tolerance = accurate ? settings.tolerance : std::max(settings.tolerance, kRoughTolerance);
    inner.aim = accurate ? settings.aim : 0;
    convex->Solve(problem, inner, slips_, &trial_);
    const bool solved = trial_.status == Status::kSolved || trial_.status == Status::kInaccurate;
    if (!solved && answered) break;
    if (!solved || accurate) *solution = trial_, answered = true;
    if (!solved) return;
    settled = UpdateSlips(problem, settings.cone) <= goal;
    accurate = small || settled;  // a rough round places the slips, but is no answer
  }
  if (!settled && solution->status == Status::kSolved) solution->status = Status::kInaccurate;
}

// Slips of the velocities of the round; returns the largest change. Also where nothing presses: with s = 0 the convex problem
// would push such a contact open to u_n = mu |u_t|.
double SlipRounds::UpdateSlips(const Problem& problem, Cone cone) {
  double change = 0;
  for (size_t c = 0; c < slips_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3 u = ContactVelocity(contact, trial_.velocities.data()) + contact.compliance * trial_.impulses[c];
    const double slip = Slip(u, contact.friction, cone);
    change = std::max(change, std::abs(slip - slips_[c]));
    slips_[c] = slip;
  }
  return change;
}

}  // namespace islet::qp
