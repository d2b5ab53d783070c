#include "qp/local_newton.h"

#include <algorithm>
#include <cmath>

namespace islet::qp {
namespace {

constexpr double kFirstStiffness = 10, kLeastStiffness = 1e-3, kMostStiffness = 1e6;  // scaled units: W_cc has trace 3
constexpr double kStiffen = 10, kStiffenLittle = 3, kSoften = 0.1;
constexpr int kEasy = 3, kFair = 6;    // Newton steps of a proximal step that may become stiffer, or a little stiffer
constexpr int kMaxInner = 25;          // Newton steps of one proximal step
constexpr double kInnerShare = 1e-14;  // of the velocities: residual of a proximal step that is as good as none
constexpr int kPatience = 20;  // proximal steps without a better answer: on the way to it the map may rise for a while
constexpr int kMaxHalvings = 8;
constexpr double kLeastDescent = 1e-4;  // of the residual, times the share of the step

double Tangent(const Vector3& x) { return std::hypot(x[1], x[2]); }

Vector3 ProjectOnCone(const Vector3& x, double mu) {
  const double tangent = Tangent(x);
  if (x[0] + mu * tangent <= 0) return Vector3::Zero();
  if (tangent <= mu * x[0]) return x;
  const double normal = (x[0] + mu * tangent) / (1 + mu * mu);
  return {normal, mu * normal * x[1] / tangent, mu * normal * x[2] / tangent};
}

Vector3 Law(Model model, const Vector3& x, double mu) {
  if (model == Model::kConvex) return ProjectOnCone(x, mu);
  if (x[0] <= 0) return Vector3::Zero();
  const double tangent = Tangent(x), share = tangent > mu * x[0] ? mu * x[0] / tangent : 1;
  return {x[0], share * x[1], share * x[2]};
}

// An element of the generalised derivative of Law.
Matrix3 LawSlope(Model model, const Vector3& x, double mu) {
  const double tangent = Tangent(x);
  const bool inside = tangent <= mu * x[0];
  if (inside && x[0] > 0) return Matrix3::Identity();
  const double cosine = tangent > 0 ? x[1] / tangent : 1, sine = tangent > 0 ? x[2] / tangent : 0;
  const Vector3 edge(1, mu * cosine, mu * sine), side(0, -sine, cosine);
  if (model == Model::kConvex) {
    const double normal = (x[0] + mu * tangent) / (1 + mu * mu);
    if (normal <= 0) return Matrix3::Zero();
    return edge * edge.transpose() / (1 + mu * mu) + mu * normal / tangent * side * side.transpose();
  }
  if (x[0] <= 0) return Matrix3::Zero();
  return edge * Vector3::UnitX().transpose() + mu * x[0] / tangent * side * side.transpose();
}

}  // namespace

NaturalMap NaturalMapOf(const ScaledLocalProblem& problem, Model model, const Eigen::VectorXd& impulses) {
  const Eigen::VectorXd velocities = problem.delassus * impulses + problem.velocity;
  double largest = 0, sum = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    Vector3 u = velocities.segment<3>(3 * c);
    if (model == Model::kCoulomb) u[0] += problem.friction[c] * Tangent(u);
    const Vector3 j = impulses.segment<3>(3 * c);
    const double map = (j - ProjectOnCone(j - u, problem.friction[c])).norm() * problem.RelativeSpeed(c);
    if (!(map <= largest)) largest = map;  // NaN too
    sum += map * map;
  }
  return {largest, std::sqrt(sum / std::max(1, problem.num_contacts()))};
}

double LocalNewton::Residual(const Eigen::VectorXd& v) {
  pulls_.noalias() = problem_->factor * v;
  pulls_ = centre_ - stiffness_ * (pulls_ + velocity_);
  impulses_.resize(pulls_.size());
  for (int c = 0; c < problem_->num_contacts(); ++c)
    impulses_.segment<3>(3 * c) = Law(model_, pulls_.segment<3>(3 * c), problem_->friction[c]);
  residual_ = v - problem_->factor.transpose() * impulses_;
  return residual_.norm();
}

// I + t A^T G A, without the contacts that do not press.
void LocalNewton::Factorise() {
  weights_.resize(problem_->num_contacts());
  for (int c = 0; c < problem_->num_contacts(); ++c)
    weights_[c] = stiffness_ * LawSlope(model_, pulls_.segment<3>(3 * c), problem_->friction[c]);
  system_.setIdentity(problem_->factor.cols(), problem_->factor.cols());
  gram_.Add(weights_, false, &system_);
  factors_.compute(system_);
}

// One proximal step. True if it was solved; either way impulses_ is where it ended. Adds to *factorisations.
bool LocalNewton::Step(int most, int* factorisations) {
  const Eigen::MatrixXd& a = problem_->factor;
  Eigen::VectorXd v = a.transpose() * centre_;
  velocity_ = problem_->velocity + problem_->delassus * centre_ - a * v;
  double size = Residual(v);
  for (int steps = 0; size > kInnerShare * stiffness_ * (1 + v.norm()); ++steps, ++*factorisations) {
    if (steps >= most) return false;
    Factorise();
    const Eigen::VectorXd step = factors_.solve(-residual_), from = v;
    double share = 1, next = 0;
    for (int halving = 0; halving <= kMaxHalvings; ++halving, share /= 2) {
      v = from + share * step;
      next = Residual(v);
      if (next <= (1 - kLeastDescent * share) * size) break;
    }
    if (!(next < size)) return ++*factorisations, false;
    size = next;
  }
  return true;
}

// Steps that were easy make the springs stiffer, those that failed softer.
int LocalNewton::Polish(const ScaledLocalProblem& problem, Model model, double goal, int max_factorisations,
                        Eigen::VectorXd* impulses) {
  gram_.Prepare(problem);
  problem_ = &problem;
  model_ = model;
  stiffness_ = kFirstStiffness;
  centre_ = *impulses;
  NaturalMap best = NaturalMapOf(problem, model, *impulses);
  int spent = 0, stalled = 0;
  while (!best.Meets(goal) && spent < max_factorisations && stiffness_ > kLeastStiffness && stalled < kPatience) {
    const int before = spent;
    const bool good = Step(std::min(kMaxInner, max_factorisations - spent), &spent);
    const NaturalMap map = NaturalMapOf(problem, model, impulses_);
    const bool better = map.rms < best.rms;
    stalled = better ? 0 : stalled + 1;
    if (better) best = map, *impulses = impulses_;
    if (good || better) {
      centre_ = impulses_;
      const double factor = spent - before <= kEasy ? kStiffen : spent - before <= kFair ? kStiffenLittle : 1;
      stiffness_ = std::min(kMostStiffness, stiffness_ * factor);
    } else {
      stiffness_ *= kSoften;
    }
  }
  return spent;
}

}  // namespace islet::qp
