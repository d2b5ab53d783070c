#include "tests/support/reference_qp.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace islet::testing {
namespace {

using Real = long double;
using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

LongVector3 ProjectOnCircle(const LongVector3& x, Real mu, LongMatrix3* derivative) {
  const Real t = x.tail<2>().norm();
  if (derivative) derivative->setZero();
  if (x[0] + mu * t <= 0) return LongVector3::Zero();
  if (t <= mu * x[0]) {
    if (derivative) derivative->setIdentity();
    return x;
  }
  const Real n = (x[0] + mu * t) / (1 + mu * mu);
  const Eigen::Matrix<Real, 2, 1> d = x.tail<2>() / t;
  if (derivative) {
    LongVector3 edge(1, mu * d[0], mu * d[1]);
    *derivative = edge * edge.transpose() / (1 + mu * mu);
    derivative->bottomRightCorner<2, 2>() += mu * n / t * (Eigen::Matrix<Real, 2, 2>::Identity() - d * d.transpose());
  }
  return {n, mu * n * d[0], mu * n * d[1]};
}

LongVector3 Facet(int h, Real mu) {
  const Real pi = std::numbers::pi_v<Real>, angle = pi * h / 4;
  return {mu * std::cos(pi / 8), std::cos(angle), std::sin(angle)};
}

// All candidates lie in the pyramid: the point itself, its foot on a facet between that facet's edges, on an edge, and
// the tip. The nearest of them is the projection.
LongVector3 ProjectOnOctagon(const LongVector3& x, Real mu, LongMatrix3* derivative) {
  LongVector3 best = LongVector3::Zero();
  Real distance = x.squaredNorm();
  if (derivative) derivative->setZero();
  bool inside = true;
  const auto offer = [&](const LongVector3& y, const LongMatrix3& slope) {
    if ((x - y).squaredNorm() >= distance) return;
    distance = (x - y).squaredNorm();
    best = y;
    if (derivative) *derivative = slope;
  };
  for (int h = 0; h < 8; ++h) {
    const LongVector3 facet = Facet(h, mu), next = Facet(h + 1, mu), before = Facet(h + 7, mu);
    inside = inside && facet.dot(x) >= 0;
    LongVector3 edge = facet.cross(next);
    edge /= edge[0];
    const LongMatrix3 on_edge = edge * edge.transpose() / edge.squaredNorm();
    if (edge.dot(x) > 0) offer(on_edge * x, on_edge);
    const LongMatrix3 on_facet = LongMatrix3::Identity() - facet * facet.transpose() / facet.squaredNorm();
    const LongVector3 foot = on_facet * x;
    if (foot[0] >= 0 && next.dot(foot) >= 0 && before.dot(foot) >= 0) offer(foot, on_facet);
  }
  if (inside) offer(x, LongMatrix3::Identity());
  return best;
}

struct Dense {
  Matrix w, response;  // W; M^-1 J^T (6 nb x 3 nc)
  Vector q, free, scale;
  Matrix a;  // kinetic: normal rows
  Vector c;
};

Dense MakeDense(const qp::Problem& problem, bool kinetic) {
  const int nb = problem.num_bodies(), nc = problem.num_contacts();
  Matrix j = Matrix::Zero(3 * nc, 6 * nb), inverse_mass = Matrix::Zero(6 * nb, 6 * nb);
  Dense dense;
  dense.free.resize(6 * nb);
  for (int i = 0; i < nb; ++i) {
    const qp::BodyTerm& body = problem.bodies[i];
    dense.free.segment(6 * i, 6) = body.velocity.cast<Real>();
    for (int k = 0; k < 3; ++k) inverse_mass(6 * i + k, 6 * i + k) = 1 / static_cast<Real>(body.mass);
    const LongMatrix3 inertia = body.inertia.cast<Real>();
    inverse_mass.block(6 * i + 3, 6 * i + 3, 3, 3) = inertia.llt().solve(LongMatrix3::Identity());
  }
  Vector drift(3 * nc);
  for (int c = 0; c < nc; ++c) {
    const qp::ContactTerm& contact = problem.contacts[c];
    if (contact.body_a >= 0) j.block(3 * c, 6 * contact.body_a, 3, 6) = contact.jacobian_a.cast<Real>();
    if (contact.body_b >= 0) j.block(3 * c, 6 * contact.body_b, 3, 6) = contact.jacobian_b.cast<Real>();
    drift.segment(3 * c, 3) = contact.drift.cast<Real>();
  }
  dense.response = inverse_mass * j.transpose();
  dense.w = j * dense.response;
  dense.q = j * dense.free + drift;
  if (kinetic) {
    dense.a.resize(nc, 3 * nc);
    dense.c.resize(nc);
  }
  for (int c = 0; c < nc; ++c) {
    if (kinetic) {
      dense.a.row(c) = dense.w.row(3 * c);
      dense.c[c] = dense.q[3 * c] - problem.contacts[c].target;
    } else {
      dense.q[3 * c] -= problem.contacts[c].target;
    }
  }
  for (int c = 0; c < nc; ++c)
    for (int k = 0; k < 3; ++k) dense.w(3 * c + k, 3 * c + k) += problem.contacts[c].compliance;
  // Per contact unit of impulse, so that every diagonal block of W has trace 3.
  dense.scale.resize(3 * nc);
  for (int c = 0; c < nc; ++c)
    dense.scale.segment(3 * c, 3).setConstant(std::sqrt(3 / dense.w.block(3 * c, 3 * c, 3, 3).trace()));
  dense.w = dense.scale.asDiagonal() * dense.w * dense.scale.asDiagonal();
  dense.q = dense.scale.cwiseProduct(dense.q);
  if (kinetic) {
    for (int c = 0; c < nc; ++c) dense.c[c] *= dense.scale[3 * c], dense.a.row(c) *= dense.scale[3 * c];
    dense.a = dense.a * dense.scale.asDiagonal();
  }
  return dense;
}

class Multipliers {
 public:
  Multipliers(const qp::Problem& problem, const Dense& dense, qp::Cone cone)
      : problem_(problem), dense_(dense), cone_(cone), nc_(problem.num_contacts()) {
    j_ = Vector::Zero(3 * nc_), y_ = Vector::Zero(3 * nc_), centre_ = j_, gamma_ = Vector::Zero(dense.c.size());
  }

  void Run(ReferenceSolution* solution) {
    double before = INFINITY;
    for (int outer = 0; outer < 80; ++outer) {
      centre_ = j_;
      for (int step = 0; step < 40; ++step) {
        ++solution->newton_steps;
        if (!NewtonStep()) break;
      }
      for (int c = 0; c < nc_; ++c) {
        const LongVector3 x = j_.segment<3>(3 * c) - y_.segment<3>(3 * c) / penalty_;
        y_.segment<3>(3 * c) = -penalty_ * (x - ProjectOnCone(x, problem_.contacts[c].friction, cone_));
      }
      if (gamma_.size() > 0) gamma_ = (gamma_ - row_penalty_ * (dense_.a * j_ + dense_.c)).cwiseMax(0);
      solution->residual = j_.allFinite() ? static_cast<double>(Residual()) : INFINITY;
      if (!std::isfinite(solution->residual)) return;
      if (solution->residual < 1e-11) break;
      if (solution->residual > 0.3 * before && penalty_ < Real(1e7)) penalty_ *= 3, row_penalty_ *= 3, prox_ /= 3;
      before = solution->residual;
    }
    for (int c = 0; c < nc_; ++c)
      j_.segment<3>(3 * c) = ProjectOnCone(j_.segment<3>(3 * c), problem_.contacts[c].friction, cone_);
  }

  const Vector& impulses() const { return j_; }

 private:
  Real Merit(const Vector& j, Vector* gradient, Matrix* hessian) const {
    const Vector wj = dense_.w * j;
    Real value = j.dot(Real(0.5) * wj + dense_.q) + Real(0.5) * prox_ * (j - centre_).squaredNorm();
    if (gradient) *gradient = wj + dense_.q + prox_ * (j - centre_);
    if (hessian) *hessian = dense_.w, hessian->diagonal().array() += prox_;
    for (int c = 0; c < nc_; ++c) {
      const LongVector3 x = j.segment<3>(3 * c) - y_.segment<3>(3 * c) / penalty_;
      LongMatrix3 slope;
      const LongVector3 outside = x - ProjectOnCone(x, problem_.contacts[c].friction, cone_, &slope);
      value += Real(0.5) * penalty_ * outside.squaredNorm();
      if (gradient) gradient->segment<3>(3 * c) += penalty_ * outside;
      if (hessian) hessian->block<3, 3>(3 * c, 3 * c) += penalty_ * (LongMatrix3::Identity() - slope);
    }
    if (gamma_.size() == 0) return value;
    const Vector lack = (gamma_ / row_penalty_ - dense_.a * j - dense_.c).cwiseMax(0);
    value += Real(0.5) * row_penalty_ * lack.squaredNorm();
    if (gradient) *gradient -= row_penalty_ * (dense_.a.transpose() * lack);
    if (hessian) {
      for (int c = 0; c < nc_; ++c)
        if (lack[c] > 0) *hessian += row_penalty_ * dense_.a.row(c).transpose() * dense_.a.row(c);
    }
    return value;
  }

  bool NewtonStep() {
    Vector gradient;
    Matrix hessian;
    const Real value = Merit(j_, &gradient, &hessian);
    if (gradient.cwiseAbs().maxCoeff() < Real(1e-14) * (1 + j_.cwiseAbs().maxCoeff())) return false;
    const Vector direction = -hessian.llt().solve(gradient);
    const Real slope = gradient.dot(direction);
    for (Real step = 1; step > Real(1e-12); step /= 2) {
      const Vector next = j_ + step * direction;
      if (Merit(next, nullptr, nullptr) > value + Real(1e-4) * step * slope) continue;
      j_ = next;
      return true;
    }
    return false;  // no descent left in these digits
  }

  // j in K, y in K*, y = gradient, y.j = 0; the rows likewise.
  Real Residual() const {
    Vector gradient = dense_.w * j_ + dense_.q;
    if (gamma_.size() > 0) gradient -= dense_.a.transpose() * gamma_;
    Real worst = 0;
    for (int c = 0; c < nc_; ++c) {
      const LongVector3 j = j_.segment<3>(3 * c), y = gradient.segment<3>(3 * c);
      worst = std::max(worst, (j - ProjectOnCone(j - y, problem_.contacts[c].friction, cone_)).cwiseAbs().maxCoeff());
    }
    if (gamma_.size() == 0) return worst;
    const Vector u = dense_.a * j_ + dense_.c;
    return std::max(worst, (gamma_ - (gamma_ - u).cwiseMax(0)).cwiseAbs().maxCoeff());
  }

  const qp::Problem& problem_;
  const Dense& dense_;
  const qp::Cone cone_;
  const int nc_;
  Real penalty_ = 300, row_penalty_ = 300, prox_ = Real(1e-6);  // tightened when progress is slow
  Vector j_, y_, centre_, gamma_;
};

}  // namespace

LongVector3 ProjectOnCone(const LongVector3& x, double friction, qp::Cone cone, LongMatrix3* derivative) {
  if (friction == 0) {
    if (derivative) derivative->setZero(), (*derivative)(0, 0) = x[0] > 0 ? 1 : 0;
    return {std::max(x[0], Real(0)), 0, 0};
  }
  return cone == qp::Cone::kCircular ? ProjectOnCircle(x, friction, derivative)
                                     : ProjectOnOctagon(x, friction, derivative);
}

ReferenceSolution SolveReference(const qp::Problem& problem, qp::Model model, qp::Cone cone) {
  const Dense dense = MakeDense(problem, model == qp::Model::kKinetic);
  Multipliers method(problem, dense, cone);
  ReferenceSolution solution;
  method.Run(&solution);
  const Vector impulses = dense.scale.cwiseProduct(method.impulses());
  const Vector v = dense.free + dense.response * impulses;
  for (int i = 0; i < v.size(); ++i) solution.velocities.push_back(static_cast<double>(v[i]));
  for (int c = 0; c < problem.num_contacts(); ++c)
    solution.impulses.push_back(impulses.segment<3>(3 * c).cast<double>());
  return solution;
}

}  // namespace islet::testing
