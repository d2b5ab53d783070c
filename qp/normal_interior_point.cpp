#include "qp/normal_interior_point.h"

#include <algorithm>
#include <cmath>

namespace islet::qp {
namespace {

constexpr int kMaxFactorisations = 30;
constexpr double kSpread = 300;      // m over the natural map of the start
constexpr double kLeastSpread = 3;   // over the m at which the gap is the tolerance
constexpr double kBack = 0.995;      // of the way to the boundary
constexpr double kShortStep = 0.02;  // twice in a row: no answer, or none that is worth the wait
// Measured on 240 problems of sphereglass (more than 800 contacts): all of Mehrotra's goal and 2 correctors 8.4 factorisations and
// 31 solves, 0.3 of it and 2 8.1 and 30, 0.3 and 1 8.6 and 26, which takes the least time (13 % less than the first).
constexpr double kGoalShare = 0.3;
constexpr int kCorrectors = 1;
constexpr double kReach = 0.3;  // by which a corrector wants to lengthen the step, of which it must bring a tenth
constexpr double kLow = 0.1, kHigh = 10;

template <int kWidth>
double SpeedOf(int a, int b, const double* normal, const double* velocities) {
  const double* va = velocities + kWidth * a;
  const double* vb = velocities + kWidth * b;
  double first = 0, second = 0;
  for (int k = 0; k < kWidth; ++k) first += normal[k] * va[k], second += normal[kWidth + k] * vb[k];
  return first + second;
}

template <int kWidth>
void Push(int a, int b, const double* normal, double impulse, double* out) {
  double* pa = out + kWidth * a;
  double* pb = out + kWidth * b;
  for (int k = 0; k < kWidth; ++k) pa[k] += impulse * normal[k];
  for (int k = 0; k < kWidth; ++k) pb[k] += impulse * normal[kWidth + k];
}

// The step that stays inside where the boundary is 1 / bound away.
double StepTo(double bound) { return bound > kBack ? kBack / bound : 1.0; }

// W_nn.
double NormalDelassus(const Problem& problem, const ContactTerm& contact) {
  double w = 0;
  const auto add = [&](int number, const Jacobian& jacobian) {
    if (number < 0) return;
    const BodyTerm& body = problem.bodies[number];
    const Vector6 normal = jacobian.row(0).transpose();
    w += normal.head<3>().squaredNorm() / body.mass;
    w += normal.tail<3>().dot(body.inverse_inertia * normal.tail<3>());
  };
  add(contact.body_a, contact.jacobian_a);
  add(contact.body_b, contact.jacobian_b);
  return w;
}

}  // namespace

bool NormalInteriorPoint::Solve(const Problem& problem, const Settings& settings, double map,
                                const std::vector<double>& velocities, std::vector<Vector3>* impulses) {
  problem_ = &problem;
  Load(problem, settings.velocity_scale);
  ChooseStart(settings, map, velocities, *impulses);
  const bool solved = width_ == 3 ? Iterate<3>(settings) : Iterate<6>(settings);
  for (size_t c = 0; c < rows_.size(); ++c) (*impulses)[c] = {rows_[c].impulse, 0, 0};
  return solved;
}

void NormalInteriorPoint::Load(const Problem& problem, double velocity_scale) {
  factorisations_ = 0;
  system_.Prepare(problem);
  width_ = system_.width();
  const int still = problem.num_bodies();
  rows_.resize(problem.contacts.size());
  for (size_t c = 0; c < rows_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    Row& row = rows_[c];
    row.a = contact.body_a < 0 ? still : contact.body_a;
    row.b = contact.body_b < 0 ? still : contact.body_b;
    for (int k = 0; k < width_; ++k) {
      row.normal[k] = contact.body_a < 0 ? 0 : contact.jacobian_a(0, k);
      row.normal[width_ + k] = contact.body_b < 0 ? 0 : contact.jacobian_b(0, k);
    }
    row.offset = contact.drift[0] - contact.target;
    row.rho = 1 / NormalDelassus(problem, contact);
  }
  mass_ = energy_ = 0;
  free_.clear();
  for (const BodyTerm& body : problem.bodies) {
    free_.insert(free_.end(), body.velocity.data(), body.velocity.data() + width_);
    mass_ += body.mass;
    energy_ += 0.5 * body.mass * (body.velocity.head<3>().squaredNorm() + velocity_scale * velocity_scale);
  }
  free_.resize(free_.size() + width_);  // of what stands still
  for (auto* x : {&v_, &pull_, &error_, &dv_, &kept_dv_}) x->assign(free_.size(), 0.0);
  sigmas_.resize(rows_.size());
}

void NormalInteriorPoint::ChooseStart(const Settings& settings, double map, const std::vector<double>& velocities,
                                      const std::vector<Vector3>& impulses) {
  for (int i = 0; i < problem_->num_bodies(); ++i)
    for (int k = 0; k < width_; ++k) v_[width_ * i + k] = velocities[6 * i + k];
  double stiffness = 0;
  for (const Row& row : rows_) stiffness += row.rho;
  const double last = std::sqrt(settings.tolerance * energy_ / stiffness);
  const double spread = std::max(kSpread * map, kLeastSpread * last);
  const double product = spread * spread * stiffness / static_cast<double>(rows_.size());
  for (size_t c = 0; c < rows_.size(); ++c) {
    Row& row = rows_[c];
    const double speed = row.offset + (width_ == 3 ? SpeedOf<3>(row.a, row.b, row.normal, v_.data())
                                                   : SpeedOf<6>(row.a, row.b, row.normal, v_.data()));
    const double x = std::max(0.0, impulses[c][0]) / row.rho - speed, square = product / row.rho;
    const double large = 0.5 * (std::sqrt(x * x + 4 * square) + std::abs(x)), small = square / large;
    row.s = x > 0 ? small : large;
    row.impulse = row.rho * (x > 0 ? large : small);
  }
}

// Returns the mean of the products s j.
template <int kWidth>
double NormalInteriorPoint::UpdateResiduals() {
  for (int i = 0; i < problem_->num_bodies(); ++i) {
    const BodyTerm& body = problem_->bodies[i];
    double change[6];
    for (int k = 0; k < kWidth; ++k) change[k] = v_[kWidth * i + k] - free_[kWidth * i + k];
    double* pull = &pull_[kWidth * i];
    for (int k = 0; k < 3; ++k) pull[k] = body.mass * change[k];
    if (kWidth == 6) Eigen::Map<Vector3>(pull + 3).noalias() = body.inertia * Eigen::Map<const Vector3>(change + 3);
  }
  error_ = pull_;
  double sum = 0;
  for (size_t c = 0; c < rows_.size(); ++c) {
    Row& row = rows_[c];
    row.primal = row.s - row.offset - SpeedOf<kWidth>(row.a, row.b, row.normal, v_.data());
    Push<kWidth>(row.a, row.b, row.normal, -row.impulse, error_.data());
    sum += row.s * row.impulse;
    sigmas_[c] = row.impulse / row.s;
    row.product = 0;
  }
  return sum / static_cast<double>(rows_.size());
}

// The direction to s j = goal less `product`. Returns 1 / the longest step, 0 or less if it has no end.
template <int kWidth>
double NormalInteriorPoint::ComputeDirection(double goal) {
  for (size_t i = 0; i < dv_.size(); ++i) dv_[i] = -pull_[i];
  for (Row& row : rows_) {
    row.dj = (goal - row.product + row.impulse * row.primal) / row.s;
    Push<kWidth>(row.a, row.b, row.normal, row.dj, dv_.data());
  }
  std::fill(dv_.end() - kWidth, dv_.end(), 0.0);
  system_.Solve(dv_.data());
  double bound = 0;
  for (size_t c = 0; c < rows_.size(); ++c) {
    Row& row = rows_[c];
    const double change = SpeedOf<kWidth>(row.a, row.b, row.normal, dv_.data());
    row.ds = change - row.primal;
    row.dj -= row.impulse + sigmas_[c] * change;
    bound = std::max({bound, -row.ds / row.s, -row.dj / row.impulse});
  }
  return bound;
}

// Pulls products that a longer step would leave far from the goal back to it, while that lengthens the step. Returns 1 / the
// longest step of the direction that is kept.
template <int kWidth>
double NormalInteriorPoint::ImproveCentrality(double goal, double bound) {
  for (int corrector = 0; corrector < kCorrectors; ++corrector) {
    const double step = StepTo(bound), reach = std::min(1.0, step + kReach);
    if (step == 1) break;
    for (Row& row : rows_) {
      row.kept_ds = row.ds, row.kept_dj = row.dj, row.kept_product = row.product;
      const double product = (row.s + reach * row.ds) * (row.impulse + reach * row.dj);
      row.product -= std::max(std::clamp(product, kLow * goal, kHigh * goal) - product, -kHigh * goal);
    }
    kept_dv_ = dv_;
    const double next = ComputeDirection<kWidth>(goal);
    if (StepTo(next) >= step + 0.1 * kReach) {
      bound = next;
      continue;
    }
    if (next >= bound) {
      for (Row& row : rows_) row.ds = row.kept_ds, row.dj = row.kept_dj, row.product = row.kept_product;
      dv_ = kept_dv_;
    } else {
      bound = next;
    }
    break;
  }
  return bound;
}

// [velocity] of the momentum, rms in the mass metric.
double NormalInteriorPoint::BalanceError() const {
  double sum = 0;
  for (int i = 0; i < problem_->num_bodies(); ++i) {
    const BodyTerm& body = problem_->bodies[i];
    const double* p = &error_[width_ * i];
    sum += Eigen::Map<const Vector3>(p).squaredNorm() / body.mass;
    if (width_ == 6) {
      const Eigen::Map<const Vector3> spin(p + 3);
      sum += spin.dot(body.inverse_inertia * spin);
    }
  }
  return std::sqrt(sum / mass_);
}

template <int kWidth>
bool NormalInteriorPoint::Iterate(const Settings& settings) {
  const double enough = settings.tolerance * settings.velocity_scale, count = static_cast<double>(rows_.size());
  for (int short_steps = 0; short_steps < 2;) {
    const double mean = UpdateResiduals<kWidth>(), balance = BalanceError();
    gap_ = mean * count / energy_;
    double worst = balance;
    for (const Row& row : rows_) worst = std::max(worst, std::abs(row.primal));
    if (!std::isfinite(gap_) || !std::isfinite(worst)) return false;
    if (gap_ <= settings.tolerance && worst <= enough) return true;
    if (factorisations_ == kMaxFactorisations) return false;
    system_.Factorise(sigmas_);
    ++factorisations_;
    const double affine = std::min(1.0, 1 / std::max(ComputeDirection<kWidth>(0), 1e-300));
    double left = 0;
    for (Row& row : rows_) {
      left += (row.s + affine * row.ds) * (row.impulse + affine * row.dj);
      row.product = row.ds * row.dj;
    }
    const double ratio = left / (count * mean), goal = kGoalShare * ratio * ratio * ratio * mean;
    const double step = StepTo(ImproveCentrality<kWidth>(goal, ComputeDirection<kWidth>(goal)));
    short_steps = step < kShortStep ? short_steps + 1 : 0;
    for (size_t i = 0; i < v_.size(); ++i) v_[i] += step * dv_[i];
    for (Row& row : rows_) {
      row.s += step * row.ds;
      row.impulse += step * row.dj;
    }
  }
  return false;
}

}  // namespace islet::qp
