#include "qp/local_solver.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "qp/one_contact.h"

namespace islet::qp {
namespace {

constexpr int kSweeps = 100;  // between two interior-point solves
constexpr int kNewtonSteps = 60;
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

Eigen::VectorXd Velocities(const ScaledLocalProblem& problem, const Eigen::VectorXd& impulses) {
  return problem.delassus * impulses + problem.velocity;
}

// Gauss-Seidel sweeps over the contacts, each solved exactly with the others held [JAJ98]; blocks of zeros are skipped.
class Sweeper {
 public:
  explicit Sweeper(const ScaledLocalProblem& problem) : problem_(problem) {
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
  const ScaledLocalProblem& problem_;
  std::vector<OneContact> contacts_;
  std::vector<int> first_, others_;  // which contacts feel an impulse at c
};

}  // namespace

void LocalSolver::Solve(const LocalProblem& problem, const Settings& settings, LocalSolution* solution) {
  *solution = {};
  solution->status = Status::kSolved;
  solution->impulses = Eigen::VectorXd::Zero(problem.velocity.size());
  solution->velocities = problem.velocity;
  solution->slips.assign(problem.num_contacts(), 0.0);
  if (problem.num_contacts() == 0) return;
  const ScaledLocalProblem scaled(problem, settings.velocity_scale);
  if (settings.model == Model::kCoulomb) {
    SolveCoulomb(scaled, settings, solution);
  } else {
    SolveConvex(scaled, settings, solution);
  }
  for (int c = 0; c < problem.num_contacts(); ++c)
    solution->impulses.segment<3>(3 * c) *= scaled.unit * scaled.scale[c];
  solution->velocities = problem.delassus * solution->impulses + problem.velocity;
  if (!solution->impulses.allFinite()) solution->status = Status::kFailed;
}

void LocalSolver::SolveConvex(const ScaledLocalProblem& problem, const Settings& settings, LocalSolution* solution) {
  const auto result =
      interior_point_.Solve(problem, settings.cone, settings.max_iterations, problem.velocity, &solution->impulses);
  solution->iterations = result.iterations;
  if (settings.cone == Cone::kCircular) {
    solution->iterations +=
        newton_.Polish(problem, Model::kConvex, settings.tolerance, kNewtonSteps, &solution->impulses);
  }
}

void LocalSolver::SolveCoulomb(const ScaledLocalProblem& problem, const Settings& settings, LocalSolution* solution) {
  const double goal = settings.coulomb_tolerance;
  Eigen::VectorXd offset = problem.velocity, impulses;
  const Sweeper sweeper(problem);
  LocalMap best{INFINITY, INFINITY};
  const auto keep = [&](const Eigen::VectorXd& j) {
    const LocalMap map = NaturalMapOf(problem, Model::kCoulomb, j);
    if (map.rms < best.rms) best = map, solution->impulses = j;
    return map;
  };
  for (int round = 1; round <= settings.coulomb_rounds; ++round) {
    const auto result = interior_point_.Solve(problem, settings.cone, settings.max_iterations, offset, &impulses);
    solution->iterations += result.iterations;
    solution->rounds = round;
    keep(impulses);
    if (best.max <= goal) break;
    sweeper.Sweep(kSweeps, &impulses);
    keep(impulses);
    if (best.max <= goal) break;
    Eigen::VectorXd polished = impulses;
    solution->iterations += newton_.Polish(problem, Model::kCoulomb, goal, kNewtonSteps, &polished);
    const LocalMap map = keep(polished);
    if (best.max <= goal) break;
    const Eigen::VectorXd u = Velocities(problem, map.rms <= best.rms ? polished : impulses);
    const Eigen::VectorXd missed =
        problem.delassus * impulses - problem.factor * (problem.factor.transpose() * impulses);
    offset = problem.velocity + missed;
    for (int c = 0; c < problem.num_contacts(); ++c)
      offset[3 * c] += Slip(u.segment<3>(3 * c), problem.friction[c], settings.cone);
  }
  solution->coulomb_reached = best.rms <= goal;
}

}  // namespace islet::qp
