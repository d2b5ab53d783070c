#include "engine/response/certificate.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "parallel/fork.h"
#include "qp/elementary.h"

namespace islet {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector2 = Eigen::Vector2d;

// Facet normals of the octagonal friction cone in the plane of the tangents, and its edges.        [SM04 Eq. 8]
Vector2 FacetDirection(int h) { return {Cosine(h * std::numbers::pi / 4), Sine(h * std::numbers::pi / 4)}; }
Vector2 EdgeDirection(int h) {
  return {Cosine((h + 0.5) * std::numbers::pi / 4), Sine((h + 0.5) * std::numbers::pi / 4)};
}

Vector3 OnRay(const Vector3& x, const Vector3& ray) { return std::max(0.0, x.dot(ray) / ray.squaredNorm()) * ray; }

Vector3 ProjectOnCircular(const Vector3& x, double mu) {
  const double t = x.tail<2>().norm();
  if (t <= mu * x[0]) return x;
  if (mu * t <= -x[0]) return Vector3::Zero();
  const Vector2 direction = t > 0 ? Vector2(x.tail<2>() / t) : Vector2::Zero();
  return OnRay(x, {1, mu * direction[0], mu * direction[1]});
}

// Nearest point of the pyramid: inside, on one of its facets, or on one of its edges.
Vector3 ProjectOnOctagon(const Vector3& x, double mu) {
  const double slope = mu * Cosine(std::numbers::pi / 8);
  const auto facet = [&](int h) -> Vector3 {
    const Vector2 d = FacetDirection(h);
    return Vector3(slope, d[0], d[1]).normalized();
  };
  const auto inside = [&](const Vector3& p) {
    for (int h = 0; h < 8; ++h)
      if (facet(h).dot(p) < -1e-14 * p.norm()) return false;
    return true;
  };
  if (inside(x)) return x;
  Vector3 best = Vector3::Zero();
  double nearest = x.squaredNorm();
  const auto offer = [&](const Vector3& p) {
    if ((p - x).squaredNorm() < nearest) nearest = (p - x).squaredNorm(), best = p;
  };
  for (int h = 0; h < 8; ++h) {
    const Vector3 on_facet = x - facet(h).dot(x) * facet(h);
    if (inside(on_facet)) offer(on_facet);
    const Vector2 e = EdgeDirection(h);
    offer(OnRay(x, {1, mu * e[0], mu * e[1]}));
  }
  return best;
}

Vector3 ProjectOnCone(const Vector3& x, double mu, qp::Cone cone) {
  if (mu == 0) return {std::max(0.0, x[0]), 0, 0};
  return cone == qp::Cone::kCircular ? ProjectOnCircular(x, mu) : ProjectOnOctagon(x, mu);
}

// Smallest w . direction over the cone's unit-normal generators: >= 0 inside the dual cone.
double DualSlack(const Vector3& w, double mu, qp::Cone cone) {
  if (cone == qp::Cone::kCircular) return w[0] - mu * w.tail<2>().norm();
  double slack = INFINITY;
  for (int h = 0; h < 8; ++h) slack = std::min(slack, w[0] + mu * EdgeDirection(h).dot(w.tail<2>()));
  return slack;
}

struct Momentum {
  double residual_squared = 0, mass = 0, energy_before = 0, energy_after = 0;
};

// sum_i |M_i (v_i - v0_i) - (J^T j)_i|^2 in the metric of M^-1.
Momentum MomentumBalance(const qp::Problem& problem, const qp::Solution& solution) {
  thread_local std::vector<Vector6, Eigen::aligned_allocator<Vector6>> push;
  push.assign(problem.bodies.size(), Vector6::Zero());
  for (size_t c = 0; c < problem.contacts.size(); ++c) {
    const qp::ContactTerm& contact = problem.contacts[c];
    if (contact.body_a >= 0) push[contact.body_a] += contact.jacobian_a.transpose() * solution.impulses[c];
    if (contact.body_b >= 0) push[contact.body_b] += contact.jacobian_b.transpose() * solution.impulses[c];
  }
  Momentum m;
  for (size_t i = 0; i < problem.bodies.size(); ++i) {
    const qp::BodyTerm& body = problem.bodies[i];
    const Vector6 v = Eigen::Map<const Vector6>(&solution.velocities[6 * i]);
    const Vector3 linear = body.mass * (v - body.velocity).head<3>() - push[i].head<3>();
    const Vector3 angular = body.inertia * (v - body.velocity).tail<3>() - push[i].tail<3>();
    m.residual_squared += linear.squaredNorm() / body.mass + angular.dot(body.inverse_inertia * angular);
    m.mass += body.mass;
    const auto energy = [&](const Vector6& u) {
      return 0.5 * body.mass * u.head<3>().squaredNorm() + 0.5 * u.tail<3>().dot(body.inertia * u.tail<3>());
    };
    m.energy_before += energy(body.velocity);
    m.energy_after += energy(v);
  }
  return m;
}

}  // namespace

Certificate Certify(const qp::Problem& problem, const qp::Solution& solution, qp::Model model, qp::Cone cone,
                    double v_ref) {
  Certificate out;
  if (problem.contacts.empty()) return out;
  const Momentum momentum = MomentumBalance(problem, solution);
  out.momentum = std::sqrt(momentum.residual_squared / momentum.mass) / v_ref;
  out.energy_gain = Worse(0.0, momentum.energy_after - momentum.energy_before);
  const bool kinetic = model == qp::Model::kKinetic && !solution.multipliers.empty();
  struct Part {
    Certificate worst;
    double gap = 0, model_sum = 0, coulomb_sum = 0;
  };
  const auto add = [&](size_t c, Part* part) {
    const qp::ContactTerm& contact = problem.contacts[c];
    const double mu = contact.friction;
    const Vector3& j = solution.impulses[c];
    const Vector3 u = qp::ContactVelocity(contact, solution.velocities.data()) + contact.compliance * j;
    const double rho = 3 / qp::DelassusTrace(problem, contact);
    // The vector that the solved model wants in K*, perpendicular to j.
    Vector3 w = u;
    if (kinetic) {
      w = qp::ContactVelocity(contact, solution.multipliers.data());
      const double gamma = solution.bounce_multipliers[c], excess = u[0] - contact.target;
      part->gap += std::abs(gamma * excess);
      part->worst.dual = Worse(part->worst.dual, -excess / v_ref);
    } else {
      w[0] += solution.slips[c] - contact.target;
    }
    Vector3 u_hat = u;
    u_hat[0] += mu * u.tail<2>().norm() - contact.target;
    part->gap += std::abs(j.dot(w));
    part->worst.cone = Worse(part->worst.cone, (j - ProjectOnCone(j, mu, cone)).norm() / (momentum.mass * v_ref));
    part->worst.dual = Worse(part->worst.dual, -DualSlack(w, mu, cone) / v_ref);
    const double nothing = u.allFinite() && j.allFinite() ? 0 : NAN;  // a projection would hide it
    const double model_map = nothing + (j - ProjectOnCone(j - rho * w, mu, cone)).norm() / rho;
    const double coulomb_map = nothing + (j - ProjectOnCone(j - rho * u_hat, mu, qp::Cone::kCircular)).norm() / rho;
    part->worst.natural_map_max = Worse(part->worst.natural_map_max, model_map);
    part->worst.coulomb_map_max = Worse(part->worst.coulomb_map_max, coulomb_map);
    part->model_sum += model_map * model_map;
    part->coulomb_sum += coulomb_map * coulomb_map;
  };
  const size_t count = problem.contacts.size();
  thread_local std::vector<Part> parts;
  parts.assign(parallel::NumRanges(count), {});
  parallel::ForkRanges(static_cast<int>(count), [to = parts.data(), &add](int first, int last) {
    for (int c = first; c < last; ++c) add(c, to + first / parallel::kAtOnce);
  });
  double gap = 0, model_sum = 0, coulomb_sum = 0;
  for (const Part& part : parts) {
    out.Include(part.worst);
    gap += part.gap, model_sum += part.model_sum, coulomb_sum += part.coulomb_sum;
  }
  out.gap = gap / (momentum.energy_before + 0.5 * momentum.mass * v_ref * v_ref);
  out.natural_map_rms = std::sqrt(model_sum / static_cast<double>(count));
  out.coulomb_map_rms = std::sqrt(coulomb_sum / static_cast<double>(count));
  return out;
}

}  // namespace islet
