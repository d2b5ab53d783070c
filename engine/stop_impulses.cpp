#include "engine/stop_impulses.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace islet {
namespace {

constexpr int kRounds = 400, kPatience = 50;
constexpr double kRank = 1e-9;  // of a block's trace: what no contact of a body can give it

double Dot(std::span<const StopImpulses::Momentum> x, std::span<const StopImpulses::Momentum> y) {
  double sum = 0;
  for (size_t i = 0; i < x.size(); ++i) sum += x[i].dot(y[i]);
  return sum;
}

}  // namespace

void StopImpulses::Prepare(const SuiteFrame& frame, std::span<const int> bodies, std::span<const int> contacts) {
  terms_.clear();
  inverses_.resize(bodies.size());
  for (const int c : contacts) {
    const Contact& contact = frame.contacts.contacts[c];
    const double press = std::max(0.0, frame.holding[c][0]);
    Term& term = terms_.emplace_back();
    term.weight = {press, contact.friction * press, contact.friction * press};
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
      if (side.body >= 0) sums_[side.body] += side.g * term.weight.asDiagonal() * side.g.transpose();
  for (size_t i = 0; i < bodies.size(); ++i) {
    const Eigen::SelfAdjointEigenSolver<Block> axes(sums_[i]);
    const double least = kRank * sums_[i].trace();
    const Momentum inverse = axes.eigenvalues().unaryExpr([least](double x) { return x > least ? 1 / x : 0; });
    inverses_[i].noalias() = axes.eigenvectors() * inverse.asDiagonal() * axes.eigenvectors().transpose();
  }
}

void StopImpulses::Multiply(std::span<const Momentum> x, std::vector<Momentum>* ax) {
  ax->assign(x.size(), Momentum::Zero());
  for (const Term& term : terms_) {
    Vector3 u = Vector3::Zero();
    for (const Side& side : term.sides)
      if (side.body >= 0) u += side.g.transpose() * x[side.body];
    const Vector3 j = term.weight.cwiseProduct(u);
    for (const Side& side : term.sides)
      if (side.body >= 0) (*ax)[side.body] += side.g * j;
  }
}

bool StopImpulses::Find(std::span<const Momentum> wanted, std::span<const double> limits, std::vector<Vector3>* impulses) {
  const size_t n = wanted.size();
  w_.assign(n, Momentum::Zero());
  rest_.assign(wanted.begin(), wanted.end());
  mild_.resize(n);
  const auto missed = [&] {
    double worst = 0;
    for (size_t i = 0; i < n; ++i) worst = std::max(worst, rest_[i].norm() / limits[i]);
    return worst;
  };
  const auto soften = [&] {
    for (size_t i = 0; i < n; ++i) mild_[i] = inverses_[i] * rest_[i];
  };
  soften();
  way_ = mild_;
  double size = Dot(rest_, mild_);
  double least = missed();
  best_ = w_;
  // What no contact can give leads the rounds astray once the rest is found.
  for (int round = 0, found = 0; least > 1 && round < kRounds && round < found + kPatience; ++round) {
    Multiply(way_, &ahead_);
    const double stiffness = Dot(way_, ahead_);
    if (!(stiffness > 0)) break;
    const double step = size / stiffness;
    for (size_t i = 0; i < n; ++i) {
      w_[i] += step * way_[i];
      rest_[i] -= step * ahead_[i];
    }
    const double now = missed();
    if (now < least) least = now, best_ = w_, found = round;
    soften();
    const double next = Dot(rest_, mild_);
    for (size_t i = 0; i < n; ++i) way_[i] = mild_[i] + next / size * way_[i];
    size = next;
  }
  impulses->resize(terms_.size());
  for (size_t c = 0; c < terms_.size(); ++c) {
    Vector3 u = Vector3::Zero();
    for (const Side& side : terms_[c].sides)
      if (side.body >= 0) u += side.g.transpose() * best_[side.body];
    (*impulses)[c] = terms_[c].weight.cwiseProduct(u);
  }
  return least <= 1;
}

}  // namespace islet
