#include "qp/newton/least_change.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "qp/body_algebra.h"
#include "qp/cone.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

constexpr int kRounds = 6;  // of refinement, each leaves a hair of what can be given; and of steps towards the centre

// The inverse Hessian of the cone's logarithmic barrier, times what makes it linear in the impulse.
Matrix3 WeightOf(const Vector3& impulse, double friction) {
  Matrix3 weight = Matrix3::Zero();
  const double press = impulse[0];
  if (!(press > 0)) return weight;
  Eigen::Vector2d tangent = impulse.tail<2>();
  const double most = friction * press, size = tangent.norm();
  if (size > most) tangent *= most / size;
  weight(0, 0) = press + (most > 0 ? tangent.squaredNorm() / (most * most) * press : 0);
  weight.bottomLeftCorner<2, 1>() = 2 * tangent;
  weight.topRightCorner<1, 2>() = 2 * tangent.transpose();
  weight.bottomRightCorner<2, 2>() =
      1 / press *
      (2 * tangent * tangent.transpose() + (most * most - tangent.squaredNorm()) * Eigen::Matrix2d::Identity());
  return weight;
}

}  // namespace

void LeastChange::Prepare(const std::vector<Vector3>& impulses, Problem* problem) {
  problem_ = problem;
  start_ = impulses;
  fresh_ = false;
}

// The factor for the impulses so far.
void LeastChange::Weigh(Aim aim) {
  Problem& problem = *problem_;
  weights_.resize(impulses_.size());
  drift_.assign(impulses_.size(), Vector3::Zero());
  double sum = 0;  // a mean as the unit: the same bits in whatever units impulses are
  for (const Vector3& j : start_) sum += j[0];
  const double unit = sum > 0 ? sum / static_cast<double>(start_.size()) : 1;
  for (BodyTerm& body : problem.bodies) body.mass = 0;
  for (size_t c = 0; c < impulses_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const Vector3 j = impulses_[c] / unit;
    weights_[c] = WeightOf(j, contact.friction);
    if (aim == Aim::kCentre) {
      weights_[c] *= 0.5 * j[0];
      drift_[c] = unit * (j - 2 * weights_[c].col(0));
    }
    for (const auto& [body, jacobian] :
         {std::pair{contact.body_a, &contact.jacobian_a}, std::pair{contact.body_b, &contact.jacobian_b}})
      if (body >= 0) problem.bodies[body].mass += kRefined * (jacobian->transpose() * weights_[c] * *jacobian).trace();
  }
  for (BodyTerm& body : problem.bodies) {
    if (!(body.mass > 0)) body.mass = 1;  // nothing presses it
    body.inertia = body.mass * Matrix3::Identity();
  }
  system_.Prepare(problem, 1);
  system_.Factorise(weights_, {});
}

void LeastChange::Multiply(const std::vector<double>& w, std::vector<double>* aw) const {
  aw->assign(w.size(), 0.0);
  for (size_t c = 0; c < weights_.size(); ++c) {
    const ContactTerm& contact = problem_->contacts[c];
    AddForce(contact, 6, 0, 1, weights_[c] * FieldVelocity(contact, 6, 0, w), aw);
  }
}

// What is missed now; returns that of the body that misses most.
double LeastChange::Miss(const std::vector<double>& limits) {
  missed_.resize(limits.size());
  for (size_t i = 0; i < limits.size(); ++i) missed_[i] = At(residual_, static_cast<int>(6 * i)).norm() / limits[i];
  return *std::max_element(missed_.begin(), missed_.end());
}

// Of step_: what of it leaves the impulses within their cones.
double LeastChange::ShareInCones(double outside) const {
  double share = 1;
  for (size_t c = 0; c < step_.size(); ++c) {
    const Vector3 &j = impulses_[c], &d = step_[c];
    const double mu = problem_->contacts[c].friction, slack = outside * j.norm();
    if (j[0] + share * d[0] < 0) share = j[0] / -d[0];
    // |t + s dt|^2 = (mu (n + s dn) + slack)^2
    const double edge = mu * j[0] + slack, a = d.tail<2>().squaredNorm() - mu * mu * d[0] * d[0],
                 b = j.tail<2>().dot(d.tail<2>()) - mu * edge * d[0], rest = j.tail<2>().squaredNorm() - edge * edge;
    const double root = b * b - a * rest, sum = root >= 0 ? b + std::sqrt(root) : 0;
    if (sum > 0) share = std::min(share, std::max(0.0, -rest / sum));
  }
  return share;
}

// step_ towards wanted_; residual_ is what it misses. What nothing can give a body stays there, and does no harm to the others. Returns
// whether all is within the limits.
bool LeastChange::Solve(const std::vector<double>& limits) {
  residual_ = wanted_;
  for (size_t c = 0; c < drift_.size(); ++c) AddForce(problem_->contacts[c], 6, 0, -1, drift_[c], &residual_);
  w_.assign(residual_.size(), 0.0);
  double worst = Miss(limits);
  for (int round = 0; worst > 1 && round < kRounds; ++round) {
    correction_ = residual_;
    system_.Solve(correction_.data());
    Multiply(correction_, &image_);
    for (size_t i = 0; i < w_.size(); ++i) {
      w_[i] += correction_[i];
      residual_[i] -= image_[i];
    }
    worst = Miss(limits);
  }
  step_.resize(weights_.size());
  for (size_t c = 0; c < weights_.size(); ++c)
    step_[c] = drift_[c] + weights_[c] * FieldVelocity(problem_->contacts[c], 6, 0, w_);
  return worst <= 1;
}

void LeastChange::Take(double share) {
  for (size_t c = 0; c < impulses_.size(); ++c) {
    const Vector3 part = share * step_[c];
    impulses_[c] += part;
    AddForce(problem_->contacts[c], 6, 0, -1, part, &wanted_);
  }
}

// So that no impulse is on its cone.
void LeastChange::DrawInside() {
  for (size_t c = 0; c < impulses_.size(); ++c) {
    const auto tangent = impulses_[c].tail<2>();
    const double most = kAlmost * problem_->contacts[c].friction * impulses_[c][0], slip = tangent.norm();
    step_[c].setZero();
    if (slip > most) step_[c].tail<2>() = (most / slip - 1) * tangent;
  }
  Take(1);
}

bool LeastChange::FindCentre(const std::vector<double>& limits) {
  DrawInside();
  fresh_ = false;
  for (int round = 0; round < kRounds; ++round) {
    Weigh(Aim::kCentre);
    if (!Solve(limits)) return false;
    const double share = ShareInCones(0);
    Take(share < 1 ? kAlmost * share : 1);
    if (share >= 1) return true;
  }
  return false;
}

bool LeastChange::Find(const std::vector<double>& wanted, const std::vector<double>& limits, double outside,
                       Reach reach, std::vector<Vector3>* change) {
  change->assign(start_.size(), Vector3::Zero());
  impulses_ = start_;
  wanted_ = wanted;
  if (!std::exchange(fresh_, true)) Weigh(Aim::kLeast);
  if (Solve(limits) && ShareInCones(outside) >= 1) {
    Take(1);
  } else if (reach == Reach::kNear || !FindCentre(limits)) {
    return false;
  }
  for (size_t c = 0; c < start_.size(); ++c) (*change)[c] = impulses_[c] - start_[c];
  return true;
}

}  // namespace islet::qp
