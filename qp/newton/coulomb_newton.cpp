#include "qp/newton/coulomb_newton.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "qp/body_algebra.h"
#include "qp/newton/proximal.h"
#include "qp/slip.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

constexpr double kStepShare = 0.03;  // of the natural map: residual of a proximal step that is as good as none
constexpr int kKrylov = 20;          // of GMRES, steps
constexpr double kForcing = 1e-2;    // of the residual, what GMRES may leave

}  // namespace

// Of forces, as by the inverse of the mass matrix.
double CoulombNewton::Dot(const std::vector<double>& p, const std::vector<double>& q) const {
  double sum = 0;
  for (size_t i = 0; i < p.size(); ++i) sum += weights_[i] * p[i] * q[i];
  return sum;
}

// Of the proximal step at v_: fills pulls_, impulses_ and residual_ = J^T j - M (v - v0); returns its size as a velocity.
double CoulombNewton::Residual() {
  const Problem& problem = *problem_;
  for (int i = 0; i < problem.num_bodies(); ++i)
    At(residual_, 6 * i) = MassTimes(problem.bodies[i], problem.bodies[i].velocity - At(v_, 6 * i));
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const double stiffness = stiffness_ * (*rho_)[c];
    Vector3 u = ContactVelocity(contact, v_.data());
    u[0] -= contact.target;
    pulls_[c] = (centre_[c] - stiffness * u) / (1 + stiffness * contact.compliance);
    impulses_[c] = CutToCone(pulls_[c], contact.friction);
    AddForce(contact, 6, 0, 1, impulses_[c], &residual_);
  }
  return std::sqrt(Dot(residual_, residual_) / total_mass_);
}

// Newton's matrix times what the factor makes of b. It has beyond its factor just friction that grows with the normal velocity, where a
// contact slides. Near the end springs are so stiff that what rounding leaves of the factor would show: there the matrix multiplies.
void CoulombNewton::Multiply(const std::vector<double>& b, const std::vector<double>& x,
                             std::vector<double>* out) const {
  const Problem& problem = *problem_;
  *out = b;
  for (int i = 0; refines_ && i < problem.num_bodies(); ++i)
    At(*out, 6 * i) = MassTimes(problem.bodies[i], At(x, 6 * i));
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const Matrix3& slope = slopes_[c];
    const auto coupling = slope.bottomLeftCorner<2, 1>();
    if (slope(0, 0) == 0 || (!refines_ && coupling.isZero(0))) continue;
    const Vector3 u = FieldVelocity(problem.contacts[c], 6, 0, x);
    const Vector3 j = refines_ ? Vector3(slope * u) : Vector3(0, coupling[0] * u[0], coupling[1] * u[0]);
    AddForce(problem.contacts[c], 6, 0, 1, j, out);
  }
}

// direction_ from residual_ by GMRES, with the factor on the right.
void CoulombNewton::FindDirection() {
  std::array<std::array<double, kKrylov + 1>, kKrylov> hessenberg;
  std::array<double, kKrylov> cosines, sines, y;
  std::array<double, kKrylov + 1> rest{};
  const double size = std::sqrt(Dot(residual_, residual_));
  for (size_t i = 0; i < residual_.size(); ++i) basis_[0][i] = residual_[i] / size;
  rest[0] = 1;
  int k = 0;
  while (k < kKrylov && std::abs(rest[k]) > kForcing) {
    steps_[k] = basis_[k];
    system_.Solve(steps_[k].data());
    Multiply(basis_[k], steps_[k], &basis_[k + 1]);
    auto& column = hessenberg[k];
    for (int i = 0; i <= k; ++i) {
      column[i] = Dot(basis_[k + 1], basis_[i]);
      for (size_t n = 0; n < residual_.size(); ++n) basis_[k + 1][n] -= column[i] * basis_[i][n];
    }
    const double left = std::sqrt(Dot(basis_[k + 1], basis_[k + 1]));
    if (left > 0)
      for (double& value : basis_[k + 1]) value /= left;
    for (int i = 0; i < k; ++i) {
      const double above = column[i];
      column[i] = cosines[i] * above + sines[i] * column[i + 1];
      column[i + 1] = cosines[i] * column[i + 1] - sines[i] * above;
    }
    const double length = std::sqrt(column[k] * column[k] + left * left);
    if (!(length > 0)) break;
    cosines[k] = column[k] / length, sines[k] = left / length;
    column[k] = length;
    rest[k + 1] = -sines[k] * rest[k];
    rest[k] *= cosines[k];
    ++k;
  }
  std::fill(direction_.begin(), direction_.end(), 0.0);
  for (int i = k - 1; i >= 0; --i) {
    y[i] = rest[i];
    for (int n = i + 1; n < k; ++n) y[i] -= hessenberg[n][i] * y[n];
    y[i] /= hessenberg[i][i];
    for (size_t n = 0; n < direction_.size(); ++n) direction_[n] += y[i] * size * steps_[i][n];
  }
}

// One proximal step from centre_ and v_, its velocities, to a residual of `aim` [velocity]. True if it was solved; either way
// impulses_ is where it ended.
bool CoulombNewton::Step(double aim, int most) {
  double size = Residual();
  const double speed = ContactSpeed(*problem_, v_.data());
  for (int steps = 0; size > aim; ++steps) {
    if (steps >= most) return false;
    for (int c = 0; c < problem_->num_contacts(); ++c) {
      const ContactTerm& contact = problem_->contacts[c];
      const double stiffness = stiffness_ * (*rho_)[c];
      slopes_[c] = stiffness / (1 + stiffness * contact.compliance) *
                   SpringSlope(pulls_[c], contact.friction, kNegligible * stiffness * speed);
      plain_slopes_[c] = slopes_[c];
      plain_slopes_[c].bottomLeftCorner<2, 1>().setZero();
    }
    system_.Factorise(plain_slopes_, {});
    ++factorisations_;
    FindDirection();
    from_ = v_;
    double share = 1, next = 0;
    for (int halving = 0; halving <= kSearchHalvings; ++halving, share /= 2) {
      for (size_t i = 0; i < v_.size(); ++i) v_[i] = from_[i] + share * direction_[i];
      next = Residual();
      if (next <= (1 - kLeastDescent * share) * size) break;
    }
    if (!(next < size)) return false;
    size = next;
  }
  return true;
}

// Of one point of all the mass that has the kinetic energy of v_.
double CoulombNewton::Speed() const { return std::sqrt(2 * KineticEnergy(*problem_, v_.data()) / total_mass_); }

void CoulombNewton::Prepare(const Problem& problem, const std::vector<double>& rho) {
  problem_ = &problem, rho_ = &rho;
  const size_t unknowns = 6 * problem.bodies.size(), contacts = problem.contacts.size();
  for (std::vector<double>* values : {&residual_, &direction_, &weights_}) values->resize(unknowns);
  total_mass_ = 0;
  for (size_t i = 0; i < problem.bodies.size(); ++i) {
    const BodyTerm& body = problem.bodies[i];
    total_mass_ += body.mass;
    At(weights_, static_cast<int>(6 * i)).head<3>().setConstant(1 / body.mass);
    At(weights_, static_cast<int>(6 * i)).tail<3>().setConstant(body.inverse_inertia.trace() / 3);
  }
  pulls_.resize(contacts), impulses_.resize(contacts), slopes_.resize(contacts), plain_slopes_.resize(contacts);
  basis_.resize(kKrylov + 1), steps_.resize(kKrylov);
  for (auto& vector : basis_) vector.resize(unknowns);
  system_.Prepare(problem, 1);
}

bool CoulombNewton::StandsOnSprings(const Problem& problem, const std::vector<double>& rho, double slow,
                                    int max_factorisations) {
  factorisations_ = 0;
  Prepare(problem, rho);
  centre_.assign(problem.contacts.size(), Vector3::Zero());
  v_.assign(6 * problem.bodies.size(), 0.0);
  refines_ = false;
  ProximalPace pace({INFINITY, INFINITY});
  double speed = INFINITY;
  while (speed > slow && factorisations_ < max_factorisations) {
    stiffness_ = pace.Stiffness(0, 0);
    const int before = factorisations_;
    if (!Step(kStepShare * slow, std::min(ProximalPace::kMostNewtonSteps, max_factorisations - before))) return false;
    const double last = std::exchange(speed, ContactSpeed(problem, v_.data()));
    if (speed > 0.5 * last) return false;
    pace.Takes(speed, true, 0, false);
  }
  return speed <= slow;
}

NaturalMap CoulombNewton::Solve(const Problem& problem, const std::vector<double>& rho, const Aim& aim,
                                int max_factorisations, std::vector<Vector3>* impulses) {
  problem_ = &problem;
  factorisations_ = 0;
  centre_ = *impulses;
  VelocitiesAfter(problem, centre_, &v_);
  NaturalMap best = CoulombMap(problem, v_, centre_, rho);
  const auto reached = [&] {
    return best.max <= std::min(aim.enough, std::max(aim.least, aim.of_speed * ContactSpeed(problem, v_.data())));
  };
  if (reached()) return best;
  Prepare(problem, rho);
  ProximalPace pace(best);
  for (int step = 0; step < max_factorisations; ++step) {  // some need no factorisation
    const int before = factorisations_;
    refines_ = best.max <= aim.enough;
    if (reached() || before >= max_factorisations || !pace.GoesOn(refines_)) break;
    const double residual = kStepShare * best.rms;
    stiffness_ = pace.Stiffness(residual, Speed());
    const bool solved = Step(residual, std::min(ProximalPace::kMostNewtonSteps, max_factorisations - before));
    VelocitiesAfter(problem, impulses_, &v_);
    const NaturalMap map = CoulombMap(problem, v_, impulses_, rho);
    if (map.rms < best.rms) best = map, *impulses = impulses_;
    if (pace.Takes(map.rms, solved, factorisations_ - before, refines_)) {
      centre_ = impulses_;
    } else {
      VelocitiesAfter(problem, centre_, &v_);
    }
  }
  return best;
}

}  // namespace islet::qp
