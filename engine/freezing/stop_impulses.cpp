#include "engine/freezing/stop_impulses.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace islet {
namespace {

constexpr int kRounds = 400, kPatience = 50;  // at most; without a smaller residual
constexpr double kSingular = 1e-9;            // of a block's trace: eigenvalue of what no contact can give a body

double Dot(std::span<const StopImpulses::Momentum> x, std::span<const StopImpulses::Momentum> y) {
  double sum = 0;
  for (size_t i = 0; i < x.size(); ++i) sum += x[i].dot(y[i]);
  return sum;
}

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

void StopImpulses::Prepare(const SuiteFrame& frame, std::span<const int> bodies, std::span<const int> contacts) {
  terms_.clear();
  inverses_.resize(bodies.size());
  for (const int c : contacts) {
    const Contact& contact = frame.contacts.contacts[c];
    Term& term = terms_.emplace_back();
    term.weight = WeightOf(frame.holding[c], contact.friction);
    const int numbers[2] = {contact.body_a, contact.body_b};
    for (int s = 0; s < 2; ++s) {
      const auto found = std::lower_bound(bodies.begin(), bodies.end(), numbers[s]);
      if (found == bodies.end() || *found != numbers[s]) continue;
      const Body& body = frame.bodies[numbers[s]];
      Side& side = term.sides[s];
      side.body = static_cast<int>(found - bodies.begin());
      for (int k = 0; k < 3; ++k) {
        const Vector3 axis = (s == 0 ? -1 : 1) * frame.frames[c].col(k);
        side.g.col(k) << axis, (contact.point_W - body.position_W).cross(axis) / body.radius;
      }
    }
  }
  sums_.assign(bodies.size(), Block::Zero());
  for (const Term& term : terms_)
    for (const Side& side : term.sides)
      if (side.body >= 0) sums_[side.body] += side.g * term.weight * side.g.transpose();
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Eigen::SelfAdjointEigenSolver<Block> axes(sums_[i]);
    const double least = kSingular * sums_[i].trace();
    const Momentum inverse = axes.eigenvalues().unaryExpr([least](double x) { return x > least ? 1 / x : 0; });
    inverses_[i].noalias() = axes.eigenvectors() * inverse.asDiagonal() * axes.eigenvectors().transpose();
  }
}

// D G^T x of one contact.
Vector3 StopImpulses::ImpulseOf(const Term& term, std::span<const Momentum> x) {
  Vector3 u = Vector3::Zero();
  for (const Side& side : term.sides)
    if (side.body >= 0) u += side.g.transpose() * x[side.body];
  return term.weight * u;
}

void StopImpulses::Multiply(std::span<const Momentum> x, std::vector<Momentum>* ax) const {
  ax->assign(x.size(), Momentum::Zero());
  for (const Term& term : terms_) {
    const Vector3 j = ImpulseOf(term, x);
    for (const Side& side : term.sides)
      if (side.body >= 0) (*ax)[side.body] += side.g * j;
  }
}

bool StopImpulses::Find(std::span<const Momentum> wanted, std::span<const double> limits,
                        std::vector<Vector3>* impulses) {
  const size_t n = wanted.size();
  w_.assign(n, Momentum::Zero());
  residual_.assign(wanted.begin(), wanted.end());
  preconditioned_.resize(n);
  const auto missed = [&] {
    double worst = 0;
    for (size_t i = 0; i < n; ++i) worst = std::max(worst, residual_[i].norm() / limits[i]);
    return worst;
  };
  const auto precondition = [&] {
    for (size_t i = 0; i < n; ++i) preconditioned_[i] = inverses_[i] * residual_[i];
  };
  precondition();
  direction_ = preconditioned_;
  double size = Dot(residual_, preconditioned_);
  double least = missed();
  best_ = w_;
  // What no contact can give leads the rounds astray once the rest is found.
  for (int round = 0, found = 0; least > 1 && round < kRounds && round < found + kPatience; ++round) {
    Multiply(direction_, &image_);
    const double stiffness = Dot(direction_, image_);
    if (!(stiffness > 0)) break;
    const double step = size / stiffness;
    for (size_t i = 0; i < n; ++i) {
      w_[i] += step * direction_[i];
      residual_[i] -= step * image_[i];
    }
    const double now = missed();
    if (now < least) least = now, best_ = w_, found = round;
    precondition();
    const double next = Dot(residual_, preconditioned_);
    for (size_t i = 0; i < n; ++i) direction_[i] = preconditioned_[i] + next / size * direction_[i];
    size = next;
  }
  impulses->resize(terms_.size());
  for (size_t c = 0; c < terms_.size(); ++c) (*impulses)[c] = ImpulseOf(terms_[c], best_);
  return least <= 1;
}

}  // namespace islet
