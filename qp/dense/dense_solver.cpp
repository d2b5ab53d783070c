#include "qp/dense/dense_solver.h"

#include "qp/direct/one_contact.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

constexpr int kSteps = 400;           // of sweeps, then of Newton's method, and so on
constexpr double kGoalShare = 0.5;    // of the tolerance: so that nobody who measures otherwise finds it missed
constexpr double kAbsurdSpeed = 1e3;  // times the velocities at hand

// Weak duality: velocities that satisfy the contacts have 0 <= j . (A v + c) <= |A^T j| |v| + j . c for all impulses in the cones.
// Whether v would have to be absurdly fast; c has the slips of the impulses.
bool ProvesInfeasible(const ScaledDenseProblem& problem, Model model, const Eigen::VectorXd& impulses) {
  Eigen::VectorXd offset = problem.velocity;
  if (model == Model::kCoulomb) {
    const Eigen::VectorXd u = problem.delassus * impulses + problem.velocity;
    for (int c = 0; c < problem.num_contacts(); ++c)
      offset[3 * c] += problem.friction[c] * TangentSize(u.segment<3>(3 * c));
  }
  const double lack = -impulses.dot(offset), push = (problem.factor.transpose() * impulses).norm();
  return lack > 0 && lack > kAbsurdSpeed * (1 + offset.norm()) * push;
}

// Gauss-Seidel sweeps over the contacts, each solved exactly with the others held [JAJ98]; blocks of zeros are skipped.
class Sweeper {
 public:
  Sweeper(const ScaledDenseProblem& problem, Model model) : problem_(problem), model_(model) {
    const Eigen::MatrixXd& w = problem.delassus;
    for (int c = 0; c < problem.num_contacts(); ++c) {
      contacts_.emplace_back(w.block<3, 3>(3 * c, 3 * c) + kExact * Matrix3::Identity());
      first_.push_back(static_cast<int>(others_.size()));
      for (int other = 0; other < problem.num_contacts(); ++other)
        if (!w.block<3, 3>(3 * other, 3 * c).isZero(0)) others_.push_back(other);
    }
    first_.push_back(static_cast<int>(others_.size()));
  }

  void Sweep(int sweeps, Eigen::VectorXd* impulses) const {
    Eigen::VectorXd u = problem_.delassus * *impulses + problem_.velocity;
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      for (int c = 0; c < problem_.num_contacts(); ++c) {
        auto j = impulses->segment<3>(3 * c);
        const Vector3 q = u.segment<3>(3 * c) - contacts_[c].w() * j;
        Vector3 next = j;
        if (model_ == Model::kCoulomb) {
          next = contacts_[c].SolveCoulomb(q, problem_.friction[c]);
        } else if (!contacts_[c].SolveConvex(q, problem_.friction[c], &next)) {
          continue;
        }
        const Vector3 change = next - j;
        j = next;
        for (int k = first_[c]; k < first_[c + 1]; ++k)
          u.segment<3>(3 * others_[k]).noalias() += problem_.delassus.block<3, 3>(3 * others_[k], 3 * c) * change;
      }
    }
  }

 private:
  const ScaledDenseProblem& problem_;
  Model model_;
  std::vector<OneContact> contacts_;
  std::vector<int> first_, others_;  // which contacts feel an impulse at c
};

}  // namespace

void DenseSolver::Solve(const DenseProblem& problem, const Settings& settings, DenseSolution* solution) {
  *solution = {};
  solution->status = Status::kSolved;
  solution->impulses = Eigen::VectorXd::Zero(problem.velocity.size());
  solution->velocities = problem.velocity;
  if (problem.num_contacts() == 0) return;
  const ScaledDenseProblem scaled(problem, settings.velocity_scale);
  SolveScaled(scaled, settings, solution);
  for (int c = 0; c < problem.num_contacts(); ++c)
    solution->impulses.segment<3>(3 * c) *= scaled.unit * scaled.scale[c];
  solution->velocities = problem.delassus * solution->impulses + problem.velocity;
  if (!solution->impulses.allFinite()) solution->status = Status::kFailed;
}

void DenseSolver::SolveScaled(const ScaledDenseProblem& problem, const Settings& settings, DenseSolution* solution) {
  const Model model = settings.model;
  const double goal = kGoalShare * settings.tolerance;
  const Sweeper sweeper(problem, model);
  NaturalMap best = NaturalMapOf(problem, model, solution->impulses);
  Eigen::VectorXd impulses = solution->impulses;
  const auto reaches = [&] {
    const NaturalMap map = NaturalMapOf(problem, model, impulses);
    if (map.rms < best.rms) best = map, solution->impulses = impulses;
    return best.Meets(goal);
  };
  bool infeasible = false;
  for (int round = 1; round <= kPatience && !best.Meets(goal) && !infeasible; ++round) {
    sweeper.Sweep(kSteps, &impulses);
    if (reaches()) break;
    infeasible = ProvesInfeasible(problem, model, impulses);
    solution->iterations += newton_.Polish(problem, model, goal, kSteps, &impulses);
    reaches();
  }
  solution->status = best.Meets(settings.tolerance) ? Status::kSolved
                     : infeasible                   ? Status::kInfeasible
                                                    : Status::kInaccurate;
}

}  // namespace islet::qp
