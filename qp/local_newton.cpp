#include "qp/local_newton.h"

#include <algorithm>
#include <cmath>

namespace islet::qp {
namespace {

constexpr double kFirstStiffness = 10, kLastStiffness = 1e8;  // scaled units, in which W_cc has trace 3
constexpr double kSoften = 0.1, kStiffen = 10;
constexpr int kMaxInner = 25;          // Newton steps of one proximal step
constexpr double kInnerShare = 1e-14;  // of the velocities: residual of a proximal step that is as good as none
constexpr int kMaxHalvings = 8;

double Tangent(const Vector3& x) { return std::hypot(x[1], x[2]); }

Vector3 ProjectOnCone(const Vector3& x, double mu) {
  const double tangent = Tangent(x);
  if (tangent <= mu * x[0]) return x;
  const double normal = (x[0] + mu * tangent) / (1 + mu * mu);
  if (normal <= 0) return Vector3::Zero();
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

LocalMap NaturalMapOf(const ScaledLocalProblem& problem, Model model, const Eigen::VectorXd& impulses) {
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

// I + t A^T G A; contacts that do not press drop out.
void LocalNewton::Factorise() {
  const Eigen::MatrixXd& a = problem_->factor;
  weighted_.resize(a.rows(), a.cols());
  for (int c = 0; c < problem_->num_contacts(); ++c) {
    const Matrix3 slope = LawSlope(model_, pulls_.segment<3>(3 * c), problem_->friction[c]);
    weighted_.middleRows<3>(3 * c).noalias() = stiffness_ * slope * a.middleRows<3>(3 * c);
  }
  system_.setIdentity(a.cols(), a.cols());
  system_.noalias() += a.transpose() * weighted_;
  factors_.compute(system_);
}

int LocalNewton::Polish(const ScaledLocalProblem& problem, Model model, double goal, int max_factorisations,
                        Eigen::VectorXd* impulses) {
  problem_ = &problem;
  model_ = model;
  stiffness_ = kFirstStiffness;
  LocalMap best = NaturalMapOf(problem, model, *impulses);
  Eigen::VectorXd v = problem.factor.transpose() * *impulses, start;
  int factorisations = 0;
  centre_ = *impulses;
  while (best.max > goal && factorisations < max_factorisations) {
    velocity_ = problem.velocity + problem.delassus * centre_ - problem.factor * (problem.factor.transpose() * centre_);
    start = v = problem.factor.transpose() * centre_;
    double size = Residual(v);
    bool good = false;
    for (int inner = 0; inner < kMaxInner && factorisations < max_factorisations; ++inner) {
      good = size <= kInnerShare * stiffness_ * (1 + v.norm());
      if (good) break;
      Factorise();
      ++factorisations;
      const Eigen::VectorXd step = factors_.solve(-residual_), from = v;
      double share = 1, next = 0;
      for (int halving = 0; halving <= kMaxHalvings; ++halving, share /= 2) {
        v = from + share * step;
        next = Residual(v);
        if (next <= (1 - 1e-4 * share) * size) break;
      }
      if (!(next < size)) break;
      size = next;
    }
    const LocalMap map = NaturalMapOf(problem, model, impulses_);
    if (map.rms < best.rms) {
      best = map;
      *impulses = impulses_;
    }
    if (good || map.rms <= best.rms) {
      centre_ = impulses_;
      stiffness_ = std::min(kLastStiffness, stiffness_ * kStiffen);
    } else {
      stiffness_ *= kSoften;
      if (stiffness_ < 1e-3) break;
    }
  }
  return factorisations;
}

}  // namespace islet::qp
