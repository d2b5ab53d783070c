#include "qp/dense/dense_newton.h"

#include <algorithm>
#include <cmath>

#include "qp/newton/proximal.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

Vector3 Law(Model model, const Vector3& x, double mu) {
  return model == Model::kConvex ? ProjectOnCircularCone(x, mu) : CutToCone(x, mu);
}

// An element of the generalised derivative of Law.
Matrix3 LawSlope(Model model, const Vector3& x, double mu) {
  if (model == Model::kCoulomb) return SpringSlope(x, mu);
  const double tangent = TangentSize(x), normal = (x[0] + mu * tangent) / (1 + mu * mu);
  if (tangent < mu * x[0]) return Matrix3::Identity();
  if (normal <= 0) return Matrix3::Zero();
  if (tangent == 0) return Vector3::UnitX().asDiagonal();  // no friction
  const double cosine = x[1] / tangent, sine = x[2] / tangent;
  const Vector3 edge(1, mu * cosine, mu * sine), side(0, -sine, cosine);
  return edge * edge.transpose() / (1 + mu * mu) + mu * normal / tangent * side * side.transpose();
}

}  // namespace

NaturalMap NaturalMapOf(const ScaledDenseProblem& problem, Model model, const Eigen::VectorXd& impulses) {
  const Eigen::VectorXd velocities = problem.delassus * impulses + problem.velocity;
  double largest = 0, sum = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    Vector3 u = velocities.segment<3>(3 * c);
    if (model == Model::kCoulomb) u[0] += problem.friction[c] * TangentSize(u);
    const Vector3 j = impulses.segment<3>(3 * c);
    const double map = (j - ProjectOnCircularCone(j - u, problem.friction[c])).norm() * problem.RelativeSpeed(c);
    if (!(map <= largest)) largest = map;  // NaN too
    sum += map * map;
  }
  return {largest, std::sqrt(sum / std::max(1, problem.num_contacts()))};
}

double DenseNewton::Residual(const Eigen::VectorXd& v) {
  pulls_.noalias() = problem_->factor * v;
  pulls_ = centre_ - stiffness_ * (pulls_ + velocity_);
  impulses_.resize(pulls_.size());
  for (int c = 0; c < problem_->num_contacts(); ++c)
    impulses_.segment<3>(3 * c) = Law(model_, pulls_.segment<3>(3 * c), problem_->friction[c]);
  residual_ = v - problem_->factor.transpose() * impulses_;
  return residual_.norm();
}

// I + t A^T G A, without the contacts that do not press.
void DenseNewton::Factorise() {
  weights_.resize(problem_->num_contacts());
  for (int c = 0; c < problem_->num_contacts(); ++c)
    weights_[c] = stiffness_ * LawSlope(model_, pulls_.segment<3>(3 * c), problem_->friction[c]);
  system_.setIdentity(problem_->factor.cols(), problem_->factor.cols());
  gram_.Add(weights_, &system_);
  factors_.compute(system_);
}

// One proximal step. True if it was solved; either way impulses_ is where it ended. Adds to *factorisations.
bool DenseNewton::Step(int most, int* factorisations) {
  const Eigen::MatrixXd& a = problem_->factor;
  Eigen::VectorXd v = a.transpose() * centre_;
  velocity_ = problem_->velocity + problem_->delassus * centre_ - a * v;
  double size = Residual(v);
  for (int steps = 0; size > kRounding * stiffness_ * (1 + v.norm()); ++steps, ++*factorisations) {
    if (steps >= most) return false;
    Factorise();
    const Eigen::VectorXd step = factors_.solve(-residual_), from = v;
    double share = 1, next = 0;
    for (int halving = 0; halving <= kSearchHalvings; ++halving, share /= 2) {
      v = from + share * step;
      next = Residual(v);
      if (next <= (1 - kLeastDescent * share) * size) break;
    }
    if (!(next < size)) return ++*factorisations, false;
    size = next;
  }
  return true;
}

int DenseNewton::Polish(const ScaledDenseProblem& problem, Model model, double goal, int max_factorisations,
                        Eigen::VectorXd* impulses) {
  gram_.Prepare(problem);
  problem_ = &problem;
  model_ = model;
  centre_ = *impulses;
  NaturalMap best = NaturalMapOf(problem, model, *impulses);
  ProximalPace pace(best);
  int spent = 0;
  while (!best.Meets(goal) && spent < max_factorisations && pace.GoesOn(false)) {
    const int before = spent;
    stiffness_ = pace.Stiffness(0, 0);
    const bool solved = Step(std::min(ProximalPace::kMostNewtonSteps, max_factorisations - spent), &spent);
    const NaturalMap map = NaturalMapOf(problem, model, impulses_);
    if (map.rms < best.rms) best = map, *impulses = impulses_;
    if (pace.Takes(map.rms, solved, spent - before, false)) centre_ = impulses_;
  }
  return spent;
}

}  // namespace islet::qp
