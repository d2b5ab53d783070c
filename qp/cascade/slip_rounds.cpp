#include "qp/cascade/slip_rounds.h"

#include <algorithm>
#include <cmath>

#include "qp/slip.h"

namespace islet::qp {
namespace {

constexpr int kSweepsOfASolve = 30;  // what an interior-point solve counts as, of the effort

}  // namespace

// Each round asks whether the slips that its problem assumed are those of its answer. The first has none, so that an island in which
// nothing slides gets the one answer of the convex problem.
void SlipRounds::Solve(const Task& task, ConvexSolver* convex, Solution* solution) {
  const Problem& problem = task.problem;
  const int rounds = std::max(1, task.settings.effort.sweeps / kSweepsOfASolve);
  slips_.assign(problem.contacts.size(), 0.0);
  bool settled = false;
  for (int round = 0; round < rounds && !settled; ++round) {
    convex->Solve(problem, task.settings, slips_, &trial_);
    const bool solved = trial_.status == Status::kSolved || trial_.status == Status::kInaccurate;
    if (solved || round == 0) *solution = trial_;
    if (!solved) break;
    settled = UpdateSlips(problem, task.settings.cone) <= task.goal();
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
