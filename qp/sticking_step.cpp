#include "qp/sticking_step.h"

#include <algorithm>
#include <cmath>

#include "qp/body_algebra.h"
#include "qp/natural_map.h"

namespace islet::qp {
namespace {

constexpr double kStiffness = 1e6;       // D, in 1 / W
constexpr int kRounds = 4;               // with one factorisation
constexpr double kLeastFriction = 1e-4;  // below it the cone is too thin a room for a step

Matrix3 ConeMetric(const Vector3& j, double mu) {
  const Vector3 x(mu * j[0], j[1], j[2]), back(1 / mu, 1, 1);
  Matrix3 d = 2 * x * x.transpose();
  d.diagonal() += (x[0] * x[0] - x.tail<2>().squaredNorm()) * Vector3(-1, 1, 1);
  return back.asDiagonal() * d * back.asDiagonal();
}

}  // namespace

void StickingMetric(const Problem& problem, const std::vector<Vector3>& impulses, const std::vector<double>& scales,
                    std::vector<Matrix3>* metric) {
  double sum = 0;
  for (size_t c = 0; c < impulses.size(); ++c) sum += impulses[c].squaredNorm() / scales[c];
  const double stiffness = kStiffness / (sum / static_cast<double>(impulses.size()));
  metric->assign(impulses.size(), Matrix3::Zero());
  for (size_t c = 0; c < impulses.size(); ++c)
    if (impulses[c][0] > 0) (*metric)[c] = stiffness * ConeMetric(impulses[c], problem.contacts[c].friction);
}

bool StickingStep::Fits(const Problem& problem, const std::vector<Vector3>& impulses) {
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const Vector3& j = impulses[c];
    const double friction = problem.contacts[c].friction;
    if (j[0] > 0 && (friction < kLeastFriction || j.tail<2>().norm() >= kInsideCone * friction * j[0])) return false;
  }
  return true;
}

// Of the contacts that press; and change_ as the forces that go against them. Returns the largest.
double StickingStep::FindMisses(const Problem& problem, const std::vector<Vector3>& impulses,
                                const std::vector<double>& velocities) {
  double worst = 0;
  change_.assign(velocities.size(), 0.0);
  for (int c = 0; c < problem.num_contacts(); ++c) {
    if (impulses[c][0] <= 0) continue;
    const ContactTerm& contact = problem.contacts[c];
    misses_[c] = ContactVelocity(contact, velocities.data());
    misses_[c][0] -= contact.target;
    worst = std::max(worst, misses_[c].squaredNorm());
    AddForce(contact, 6, 0, -1, metric_[c] * misses_[c], &change_);
  }
  return std::sqrt(worst);
}

void StickingStep::Take(const Problem& problem, const std::vector<double>& scales, double goal,
                        std::vector<Vector3>* impulses, std::vector<double>* velocities) {
  StickingMetric(problem, *impulses, scales, &metric_);
  misses_.resize(impulses->size());
  system_.Prepare(problem, 1);
  system_.Factorise(problem, metric_, {});
  for (int round = 0; round < kRounds && FindMisses(problem, *impulses, *velocities) > goal; ++round) {
    system_.Solve(change_.data());
    for (int c = 0; c < problem.num_contacts(); ++c) {
      Vector3& j = (*impulses)[c];
      if (j[0] <= 0) continue;
      const Vector3 left = misses_[c] + FieldVelocity(problem.contacts[c], 6, 0, change_);
      j = ProjectOnCircularCone(j - metric_[c] * left, problem.contacts[c].friction);
    }
    VelocitiesAfter(problem, *impulses, velocities);
  }
}

}  // namespace islet::qp
