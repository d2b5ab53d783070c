#include "qp/normal_sweeps.h"

#include <algorithm>
#include <cmath>

#include "qp/normal_system.h"

namespace islet::qp {
namespace {

constexpr double kMaxMomentum = 0.8;
constexpr double kMaxGrowth = 2;  // of |x - z|^2 from sweep to sweep

}  // namespace

void NormalSweeps::Load(const Problem& problem, const std::vector<Vector3>& impulses,
                        const std::vector<double>& velocities) {
  width_ = HasLeverArms(problem) ? 6 : 3;
  const int still = problem.num_bodies();
  rows_.resize(problem.contacts.size());
  for (size_t c = 0; c < rows_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    Row& row = rows_[c];
    double w = 0;
    const auto load = [&](int number, const Jacobian& jacobian, double* normal, double* response) {
      std::fill_n(normal, width_, 0.0);
      std::fill_n(response, width_, 0.0);
      if (number < 0) return still;
      const BodyTerm& body = problem.bodies[number];
      for (int k = 0; k < width_; ++k) normal[k] = jacobian(0, k);
      for (int k = 0; k < 3; ++k) response[k] = normal[k] / body.mass;
      if (width_ == 6)
        Eigen::Map<Vector3>(response + 3).noalias() = body.inverse_inertia * Eigen::Map<const Vector3>(normal + 3);
      for (int k = 0; k < width_; ++k) w += normal[k] * response[k];
      return number;
    };
    row.a = load(contact.body_a, contact.jacobian_a, row.normal, row.response);
    row.b = load(contact.body_b, contact.jacobian_b, row.normal + width_, row.response + width_);
    row.offset = contact.drift[0] - contact.target;
    row.rho = 1 / w;
    row.impulse = row.previous = impulses[c][0];
  }
  velocities_.assign(static_cast<size_t>(width_) * (problem.bodies.size() + 1), 0.0);
  for (int i = 0; i < still; ++i)
    for (int k = 0; k < width_; ++k) velocities_[width_ * i + k] = velocities[6 * i + k];
  previous_ = velocities_;
}

// From z = x + momentum (x - previous), whose velocities must be there, to the new x and its velocities.
template <int kWidth>
NormalSweeps::Sums NormalSweeps::SweepOnce(double momentum) {
  Sums sums;
  for (Row& row : rows_) {
    double* va = &velocities_[static_cast<size_t>(kWidth) * row.a];
    double* vb = &velocities_[static_cast<size_t>(kWidth) * row.b];
    double first = row.offset, second = 0;
    for (int k = 0; k < kWidth; ++k) first += row.normal[k] * va[k], second += row.normal[kWidth + k] * vb[k];
    const double start = row.impulse + momentum * (row.impulse - row.previous);
    const double next = std::max(0.0, start - row.rho * (first + second)), change = next - start;
    sums.largest = std::max(sums.largest, std::abs(change) / row.rho);
    sums.change += change * change / row.rho;
    sums.ahead += change * (next - row.impulse) / row.rho;
    row.previous = row.impulse;
    row.impulse = next;
    for (int k = 0; k < kWidth; ++k) va[k] += change * row.response[k];
    for (int k = 0; k < kWidth; ++k) vb[k] += change * row.response[kWidth + k];
  }
  return sums;
}

// The velocities of x + momentum (x - previous): they are linear in the impulses.
void NormalSweeps::Extrapolate(double momentum) {
  for (size_t i = 0; i < velocities_.size(); ++i) {
    const double v = velocities_[i];
    velocities_[i] = v + momentum * (v - previous_[i]);
    previous_[i] = v;
  }
}

int NormalSweeps::Sweep(const Problem& problem, int max_sweeps, double tolerance, std::vector<Vector3>* impulses,
                        std::vector<double>* velocities) {
  Load(problem, *impulses, *velocities);
  double theta = 1, last_change = INFINITY, momentum = 0;
  int sweep = 0;
  while (sweep < max_sweeps) {
    ++sweep;
    Extrapolate(momentum);
    const Sums sums = width_ == 3 ? SweepOnce<3>(momentum) : SweepOnce<6>(momentum);
    if (sums.largest <= tolerance) break;
    const bool astray = sums.ahead < 0 || sums.change > kMaxGrowth * last_change;
    const double next = astray ? 1 : 0.5 * (1 + std::sqrt(1 + 4 * theta * theta));
    momentum = astray ? 0 : std::min((theta - 1) / next, kMaxMomentum);
    theta = next;
    last_change = sums.change;
  }
  for (int i = 0; i < problem.num_bodies(); ++i)
    for (int k = 0; k < width_; ++k) (*velocities)[6 * i + k] = velocities_[width_ * i + k];
  for (size_t c = 0; c < rows_.size(); ++c) (*impulses)[c] = {rows_[c].impulse, 0, 0};
  return sweep;
}

}  // namespace islet::qp
