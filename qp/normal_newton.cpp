#include "qp/normal_newton.h"

#include <algorithm>
#include <cmath>

namespace islet::qp {
namespace {

// sigma W_nn. Measured on sphereglass: 1e3 takes 1.6 factorisations a problem, 1e4 2.7, 1e5 4.0; larger ones take fewer rounds,
// but of a function with sharper bends.
constexpr double kPenalty = 1e3;
constexpr double kPenaltyGrowth = 30;  // where a round gains less than kRoundGain, which it may kMaxStalls times
constexpr double kRoundGain = 0.5;
constexpr int kMaxStalls = 2;
constexpr double kRoundShare = 0.1;  // of what the next round has to do: gradient [velocity] at which a round ends
constexpr double kFlatSlope = 0.1;   // of the slope at the start, where a line search ends
constexpr int kMaxProbes = 12;

using Vector = Eigen::Map<Eigen::VectorXd>;
using ConstVector = Eigen::Map<const Eigen::VectorXd>;

// M x of one body, in its first `width` unknowns.
void MassTimes(const BodyTerm& body, int width, const double* x, double* out) {
  for (int i = 0; i < 3; ++i) out[i] = body.mass * x[i];
  if (width == 6) Eigen::Map<Vector3>(out + 3).noalias() = body.inertia * Eigen::Map<const Vector3>(x + 3);
}

double InverseMassNorm(const BodyTerm& body, int width, const double* p) {
  double sum = Eigen::Map<const Vector3>(p).squaredNorm() / body.mass;
  if (width == 6) {
    const Eigen::Map<const Vector3> spin(p + 3);
    sum += spin.dot(body.inverse_inertia * spin);
  }
  return sum;
}

}  // namespace

bool NormalNewton::Solve(const Problem& problem, double goal, int max_factorisations, std::vector<Vector3>* impulses) {
  problem_ = &problem;
  Load(problem, *impulses);
  SetConsistentVelocities();
  double best = INFINITY, map = INFINITY;
  for (int stalls = 0; map > goal && stalls <= kMaxStalls;) {
    if (!Minimise(goal, max_factorisations)) break;
    for (Row& row : rows_) row.rest = row.impulse;
    SetConsistentVelocities();
    map = WorstMap();
    if (map > kRoundGain * best) {
      ++stalls;
      for (Row& row : rows_) row.sigma *= kPenaltyGrowth;
    }
    best = std::min(best, map);
  }
  for (size_t c = 0; c < rows_.size(); ++c) (*impulses)[c] = {rows_[c].rest, 0, 0};
  return map <= goal;
}

void NormalNewton::Load(const Problem& problem, const std::vector<Vector3>& impulses) {
  factorisations_ = 0;
  system_.Prepare(problem);
  width_ = system_.width();
  rows_.resize(problem.contacts.size());
  for (size_t c = 0; c < rows_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const double rho = 1 / DelassusBlock(problem, contact)(0, 0);
    rows_[c] = {contact.body_a,
                contact.body_b,
                contact.jacobian_a.row(0).transpose(),
                contact.jacobian_b.row(0).transpose(),
                contact.drift[0] - contact.target,
                rho,
                kPenalty * rho,
                std::max(0.0, impulses[c][0]),
                0,
                0,
                0};
  }
  free_.clear();
  total_mass_ = 0;
  for (const BodyTerm& body : problem.bodies) {
    free_.insert(free_.end(), body.velocity.data(), body.velocity.data() + width_);
    total_mass_ += body.mass;
  }
  for (auto* v : {&v_, &gradient_, &step_, &scratch_}) v->resize(free_.size());
  sigmas_.resize(rows_.size());
}

double NormalNewton::SpeedOf(const Row& row, const std::vector<double>& velocities) const {
  double speed = 0;
  if (row.a >= 0) speed += row.normal_a.head(width_).dot(ConstVector(&velocities[width_ * row.a], width_));
  if (row.b >= 0) speed += row.normal_b.head(width_).dot(ConstVector(&velocities[width_ * row.b], width_));
  return speed;
}

void NormalNewton::UpdateSpeeds() {
  for (Row& row : rows_) row.speed = SpeedOf(row, v_) + row.offset;
}

// v = v0 + M^-1 J^T j' for the impulses in `rest`.
void NormalNewton::SetConsistentVelocities() {
  std::fill(scratch_.begin(), scratch_.end(), 0.0);
  for (const Row& row : rows_) {
    if (row.a >= 0) Vector(&scratch_[width_ * row.a], width_) += row.rest * row.normal_a.head(width_);
    if (row.b >= 0) Vector(&scratch_[width_ * row.b], width_) += row.rest * row.normal_b.head(width_);
  }
  for (int i = 0; i < problem_->num_bodies(); ++i) {
    const BodyTerm& body = problem_->bodies[i];
    const double* p = &scratch_[width_ * i];
    for (int k = 0; k < 3; ++k) v_[width_ * i + k] = free_[width_ * i + k] + p[k] / body.mass;
    if (width_ == 6) {
      const Eigen::Map<const Vector3> spin(p + 3);
      Vector(&v_[6 * i + 3], 3) = body.velocity.tail<3>() + body.inverse_inertia * spin;
    }
  }
  UpdateSpeeds();
}

double NormalNewton::WorstMap() const {
  double worst = 0;
  for (const Row& row : rows_) worst = std::max(worst, std::abs(std::min(row.rest / row.rho, row.speed)));
  return worst;
}

// One round, from v_ to the impulses. False if the factorisations did not suffice.
bool NormalNewton::Minimise(double goal, int max_factorisations) {
  double error = Evaluate();
  const auto enough = [&] {
    double next = goal;
    for (const Row& row : rows_) next = std::max(next, std::abs(row.impulse - row.rest) / row.sigma);
    return error <= kRoundShare * next;
  };
  while (!enough()) {
    if (factorisations_ >= max_factorisations || !std::isfinite(error)) return false;
    system_.Factorise(sigmas_);
    ++factorisations_;
    for (size_t i = 0; i < step_.size(); ++i) step_[i] = -gradient_[i];
    system_.Solve(step_.data());
    for (Row& row : rows_) row.change = SpeedOf(row, step_);
    const double step = SearchLine();
    for (size_t i = 0; i < v_.size(); ++i) v_[i] += step * step_[i];
    UpdateSpeeds();
    error = Evaluate();
  }
  return true;
}

// Impulses, open contacts and gradient at v_. Returns the size of the gradient [velocity]: rms in the mass metric.
double NormalNewton::Evaluate() {
  for (size_t i = 0; i < v_.size(); ++i) scratch_[i] = v_[i] - free_[i];
  for (int i = 0; i < problem_->num_bodies(); ++i)
    MassTimes(problem_->bodies[i], width_, &scratch_[width_ * i], &gradient_[width_ * i]);
  for (size_t c = 0; c < rows_.size(); ++c) {
    Row& row = rows_[c];
    row.impulse = std::max(0.0, row.rest - row.sigma * row.speed);
    sigmas_[c] = row.impulse > 0 ? row.sigma : 0;
    if (row.impulse == 0) continue;
    if (row.a >= 0) Vector(&gradient_[width_ * row.a], width_) -= row.impulse * row.normal_a.head(width_);
    if (row.b >= 0) Vector(&gradient_[width_ * row.b], width_) -= row.impulse * row.normal_b.head(width_);
  }
  double sum = 0;
  for (int i = 0; i < problem_->num_bodies(); ++i)
    sum += InverseMassNorm(problem_->bodies[i], width_, &gradient_[width_ * i]);
  return std::sqrt(sum / total_mass_);
}

// Along the step the function's derivative only grows. Where it does not yet pass zero by the end of the step, all of it is
// taken; else false position with halved weights finds a place where it is nearly zero.
double NormalNewton::SearchLine() const {
  double low = 0, high = 1;
  double below = SlopeAt(0), above = SlopeAt(1);
  const double flat = kFlatSlope * std::abs(below);
  if (above <= flat) return 1;
  for (int probe = 0; probe < kMaxProbes; ++probe) {
    const double width = high - low;
    const double at = std::clamp(low - width * below / (above - below), low + 0.01 * width, high - 0.01 * width);
    const double slope = SlopeAt(at);
    if (std::abs(slope) <= flat) return at;
    if (slope < 0) {
      low = at, below = slope, above *= 0.5;
    } else {
      high = at, above = slope, below *= 0.5;
    }
  }
  return low > 0 ? low : high;
}

double NormalNewton::SlopeAt(double step) const {
  double slope = 0, there[6], momentum[6];
  for (int i = 0; i < problem_->num_bodies(); ++i) {
    const double* direction = &step_[width_ * i];
    for (int k = 0; k < width_; ++k) there[k] = v_[width_ * i + k] + step * direction[k] - free_[width_ * i + k];
    MassTimes(problem_->bodies[i], width_, there, momentum);
    for (int k = 0; k < width_; ++k) slope += direction[k] * momentum[k];
  }
  for (const Row& row : rows_)
    slope -= row.change * std::max(0.0, row.rest - row.sigma * (row.speed + step * row.change));
  return slope;
}

}  // namespace islet::qp
