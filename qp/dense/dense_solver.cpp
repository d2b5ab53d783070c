#include "qp/dense/dense_solver.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "qp/direct/one_contact.h"

namespace islet::qp {
namespace {

constexpr int kSweeps = 100;        // between two interior-point solves
constexpr int kNewtonSteps = 150;   // between two interior-point solves
constexpr int kMostRounds = 30;     // of exact Coulomb
constexpr double kPaid = 0.5;       // what a round must have made of the best map to have its answer followed up
constexpr double kGoalShare = 0.5;  // of the tolerance: so that nobody who measures otherwise finds it missed
constexpr double kSofteningOfBlocks = 1e-12;  // scaled: blocks W_cc may be singular

// De Saxce's term: mu |u_t|; for the octagon the support function of its base, which is largest at an edge.
double Slip(const Vector3& u, double friction, Cone cone) {
  if (cone == Cone::kCircular) return friction * std::hypot(u[1], u[2]);
  double largest = 0;
  for (int k = 0; k < 8; ++k) {
    const double angle = (0.5 + k) * std::numbers::pi / 4;
    largest = std::max(largest, -(std::cos(angle) * u[1] + std::sin(angle) * u[2]));
  }
  return friction * largest;
}

Eigen::VectorXd Velocities(const ScaledDenseProblem& problem, const Eigen::VectorXd& impulses) {
  return problem.delassus * impulses + problem.velocity;
}

// c of the next interior-point solve: q, the slips of the given impulses, and what the factor misses of W. Returns the root
// mean square of the change, over the velocity scale.
double UpdateOffset(const ScaledDenseProblem& problem, Cone cone, const Eigen::VectorXd& impulses,
                    Eigen::VectorXd* offset) {
  const Eigen::VectorXd u = Velocities(problem, impulses), before = *offset;
  *offset = u - problem.factor * (problem.factor.transpose() * impulses);
  double sum = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    (*offset)[3 * c] += Slip(u.segment<3>(3 * c), problem.friction[c], cone);
    const Vector3 change = (*offset - before).segment<3>(3 * c) * problem.RelativeSpeed(c);
    sum += change.squaredNorm();
  }
  return std::sqrt(sum / problem.num_contacts());
}

Status StatusOf(const DenseInteriorPoint::Result& result, double gap) {
  if (result.gap <= gap && result.residual <= std::sqrt(gap)) return Status::kSolved;
  return result.infeasible ? Status::kInfeasible : Status::kInaccurate;
}

// Gauss-Seidel sweeps over the contacts, each solved exactly with the others held [JAJ98]; blocks of zeros are skipped.
class Sweeper {
 public:
  explicit Sweeper(const ScaledDenseProblem& problem) : problem_(problem) {
    const Eigen::MatrixXd& w = problem.delassus;
    for (int c = 0; c < problem.num_contacts(); ++c) {
      contacts_.emplace_back(w.block<3, 3>(3 * c, 3 * c) + kSofteningOfBlocks * Matrix3::Identity());
      first_.push_back(static_cast<int>(others_.size()));
      for (int other = 0; other < problem.num_contacts(); ++other)
        if (!w.block<3, 3>(3 * other, 3 * c).isZero(0)) others_.push_back(other);
    }
    first_.push_back(static_cast<int>(others_.size()));
  }

  void Sweep(int sweeps, Eigen::VectorXd* impulses) const {
    Eigen::VectorXd u = Velocities(problem_, *impulses);
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      for (int c = 0; c < problem_.num_contacts(); ++c) {
        auto j = impulses->segment<3>(3 * c);
        const Vector3 q = u.segment<3>(3 * c) - contacts_[c].w() * j;
        const Vector3 next = contacts_[c].SolveCoulomb(q, problem_.friction[c]);
        const Vector3 change = next - j;
        j = next;
        for (int k = first_[c]; k < first_[c + 1]; ++k)
          u.segment<3>(3 * others_[k]).noalias() += problem_.delassus.block<3, 3>(3 * others_[k], 3 * c) * change;
      }
    }
  }

 private:
  const ScaledDenseProblem& problem_;
  std::vector<OneContact> contacts_;
  std::vector<int> first_, others_;  // which contacts feel an impulse at c
};

}  // namespace

void DenseSolver::Solve(const DenseProblem& problem, const Settings& settings, DenseSolution* solution) {
  *solution = {};
  solution->status = Status::kSolved;
  solution->impulses = Eigen::VectorXd::Zero(problem.velocity.size());
  solution->velocities = problem.velocity;
  solution->slips.assign(problem.num_contacts(), 0.0);
  if (problem.num_contacts() == 0) return;
  const ScaledDenseProblem scaled(problem, settings.velocity_scale);
  if (settings.model == Model::kCoulomb && settings.cone == Cone::kCircular) {
    SolveCoulomb(scaled, settings, solution);
  } else if (settings.model == Model::kCoulomb) {
    SolveCoulombOctagon(scaled, settings, solution);
  } else {
    SolveConvex(scaled, settings, solution);
  }
  for (int c = 0; c < problem.num_contacts(); ++c)
    solution->impulses.segment<3>(3 * c) *= scaled.unit * scaled.scale[c];
  solution->velocities = problem.delassus * solution->impulses + problem.velocity;
  if (!solution->impulses.allFinite()) solution->status = Status::kFailed;
}

void DenseSolver::SolveConvex(const ScaledDenseProblem& problem, const Settings& settings, DenseSolution* solution) {
  const auto result =
      interior_point_.Solve(problem, settings.cone, settings.max_iterations, problem.velocity, &solution->impulses);
  solution->iterations = result.iterations;
  if (settings.cone == Cone::kCircular) {
    solution->iterations +=
        newton_.Polish(problem, Model::kConvex, kGoalShare * settings.tolerance, kNewtonSteps, &solution->impulses);
    const bool reached = NaturalMapOf(problem, Model::kConvex, solution->impulses).Meets(settings.tolerance);
    solution->status = reached ? Status::kSolved : result.infeasible ? Status::kInfeasible : Status::kInaccurate;
  } else {
    solution->status = StatusOf(result, settings.tolerance * settings.tolerance);
  }
}

void DenseSolver::SolveCoulomb(const ScaledDenseProblem& problem, const Settings& settings, DenseSolution* solution) {
  const double goal = kGoalShare * settings.tolerance;
  Eigen::VectorXd offset = problem.velocity, impulses;
  const Sweeper sweeper(problem);
  NaturalMap best{INFINITY, INFINITY};
  double best_before = INFINITY;  // of the rounds but the last
  bool infeasible = false;        // without slips; with them sliding contacts need not open
  const auto keep = [&](const Eigen::VectorXd& j) {
    const NaturalMap map = NaturalMapOf(problem, Model::kCoulomb, j);
    if (map.rms < best.rms) best = map, solution->impulses = j;
    return map;
  };
  for (int round = 1; round <= kMostRounds; ++round) {
    const auto result = interior_point_.Solve(problem, settings.cone, settings.max_iterations, offset, &impulses);
    solution->iterations += result.iterations;
    infeasible = result.infeasible;
    const NaturalMap inner = keep(impulses);
    if (best.Meets(goal)) break;
    Eigen::VectorXd start = impulses;
    sweeper.Sweep(kSweeps, &start);
    const NaturalMap swept = keep(start);
    if (best.Meets(goal)) break;
    if (inner.rms < swept.rms) start = impulses;
    // The best so far, unless it has been tried in vain.
    if (best.rms < std::min(inner.rms, swept.rms) && best.rms < kPaid * best_before) start = solution->impulses;
    best_before = best.rms;
    solution->iterations += newton_.Polish(problem, Model::kCoulomb, goal, kNewtonSteps, &start);
    keep(start);
    if (best.Meets(goal)) break;
    UpdateOffset(problem, Cone::kCircular, start, &offset);
  }
  solution->status = best.Meets(settings.tolerance) ? Status::kSolved
                     : infeasible                   ? Status::kInfeasible
                                                    : Status::kInaccurate;
}

// The octagon has no Newton's finish and no sweeps: the round whose slips are closest to those of its answer is kept.
void DenseSolver::SolveCoulombOctagon(const ScaledDenseProblem& problem, const Settings& settings,
                                      DenseSolution* solution) {
  Eigen::VectorXd offset = problem.velocity, impulses;
  double best = INFINITY;
  for (int round = 1; round <= kMostRounds && best > kGoalShare * settings.tolerance; ++round) {
    const auto result = interior_point_.Solve(problem, settings.cone, settings.max_iterations, offset, &impulses);
    solution->iterations += result.iterations;
    const double change = UpdateOffset(problem, Cone::kOctagon, impulses, &offset);
    if (change < best) {
      best = change;
      solution->impulses = impulses;
      solution->status = StatusOf(result, settings.tolerance * settings.tolerance);
    }
  }
  if (!(best <= settings.tolerance) && solution->status == Status::kSolved) solution->status = Status::kInaccurate;
}

}  // namespace islet::qp
