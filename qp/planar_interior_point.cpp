#include "qp/planar_interior_point.h"

#include <algorithm>
#include <cmath>

#include "qp/body_algebra.h"

namespace islet::qp {
namespace {

constexpr double kStepShare = 0.995;   // of the way to the boundary
constexpr double kResidualShare = 2;   // residuals [velocity] may be this many times the tolerance of the gap
constexpr double kSoftness = 3e-2;     // of a contact's own W_nn, where impulses near given ones are asked for
constexpr double kLeastShare = 0.1;    // of the aim: least mean complementarity
constexpr double kRefineBelow = 1e-4;  // gap from which directions are refined
constexpr int kMaxRefinements = 4;

double Dot(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

}  // namespace

void PlanarInteriorPoint::Solve(const Problem& problem, std::span<const PlanarWeight> weights, const Settings& settings,
                                std::span<const double> slips, Solution* solution, std::span<const Vector3> near) {
  Load(problem, weights, settings, slips, near);
  ChooseStart();
  solution->iterations = 0;
  solution->status = Iterate(settings, solution);
  Extract(problem, settings.velocity_scale, slips, near, solution);
}

void PlanarInteriorPoint::Load(const Problem& problem, std::span<const PlanarWeight> weights, const Settings& settings,
                               std::span<const double> slips, std::span<const Vector3> near) {
  const size_t nb = problem.bodies.size(), nc = problem.contacts.size();
  const double per_velocity = 1 / settings.velocity_scale;
  mass_ = 0;
  for (const BodyTerm& body : problem.bodies) mass_ += body.mass;
  mean_mass_ = mass_ / static_cast<double>(nb);
  mass_ /= mean_mass_;
  masses_.clear(), free_.clear();
  energy_scale_ = 0;
  for (const BodyTerm& body : problem.bodies) {
    const double mass = body.mass / mean_mass_;
    masses_.push_back({mass, mass, body.inertia(2, 2) / mean_mass_});
    free_.push_back(
        {body.velocity[0] * per_velocity, body.velocity[1] * per_velocity, body.velocity[5] * per_velocity});
    energy_scale_ += 0.5 * mass;
    for (int k = 0; k < 3; ++k) energy_scale_ += 0.5 * masses_.back()[k] * free_.back()[k] * free_.back()[k];
  }
  energy_limit_ = std::isfinite(settings.energy_limit)
                      ? settings.energy_limit * per_velocity * per_velocity / mean_mass_
                      : 1e6 * energy_scale_;
  softness_.assign(nc, 0.0);
  contacts_.clear();
  for (size_t c = 0; c < nc; ++c) {
    const ContactTerm& term = problem.contacts[c];
    const auto row = [](const Jacobian& j, int r) { return Flat{j(r, 0), j(r, 1), j(r, 5)}; };
    double offset = (term.drift[0] - term.target + (slips.empty() ? 0 : slips[c])) * per_velocity;
    if (!near.empty()) {
      softness_[c] = kSoftness * weights[c].response / weights[c].size;
      offset -= softness_[c] * near[c][0] * per_velocity;
    }
    contacts_.push_back({term.body_a, term.body_b, row(term.jacobian_a, 0), row(term.jacobian_a, 1),
                         row(term.jacobian_b, 0), row(term.jacobian_b, 1), term.friction, offset,
                         term.drift[1] * per_velocity, softness_[c] * mean_mass_, static_cast<double>(weights[c].size),
                         weights[c].response * mean_mass_});
  }
  system_.Prepare(problem, 1 / mean_mass_);
  for (auto* v : {&v_, &dual_, &dv_, &error_}) v->assign(nb, Flat{});
  for (auto* v : {&s_, &z_, &primal_, &target_, &ds_, &dz_, &g_, &best_z_}) v->assign(nc, Sides{});
  d_.resize(nc);
  blocks_.assign(nc, Matrix3::Zero());
}

PlanarInteriorPoint::Sides PlanarInteriorPoint::Velocity(const Contact& contact, const std::vector<Flat>& v) const {
  double n = 0, t = 0;
  if (contact.a >= 0) n += Dot(contact.normal_a, v[contact.a]), t += Dot(contact.tangent_a, v[contact.a]);
  if (contact.b >= 0) n += Dot(contact.normal_b, v[contact.b]), t += Dot(contact.tangent_b, v[contact.b]);
  return {n + contact.friction * t, n - contact.friction * t};
}

// force += sign G^T z.
void PlanarInteriorPoint::AddForce(const Contact& contact, const Sides& z, double sign, std::vector<Flat>* force) {
  const double n = sign * (z[0] + z[1]), t = sign * contact.friction * (z[0] - z[1]);
  const auto add = [&](int body, const Flat& normal, const Flat& tangent) {
    for (int k = 0; k < 3; ++k) (*force)[body][k] += n * normal[k] + t * tangent[k];
  };
  if (contact.a >= 0) add(contact.a, contact.normal_a, contact.tangent_a);
  if (contact.b >= 0) add(contact.b, contact.normal_b, contact.tangent_b);
}

// Velocities as they are, rows pushed inside by one unit, impulses that would stop one unit of velocity at the contact alone.
void PlanarInteriorPoint::ChooseStart() {
  v_ = free_;
  for (size_t c = 0; c < contacts_.size(); ++c) {
    const Contact& contact = contacts_[c];
    const Sides u = Velocity(contact, v_);
    const double n = contact.offset_n, t = contact.friction * contact.offset_t;
    const double push = 1 + std::max(0.0, -std::min(u[0] + n + t, u[1] + n - t));
    s_[c] = {u[0] + n + t + push, u[1] + n - t + push};
    const double impulse = 0.5 * contact.size / contact.response;
    z_[c] = {impulse, impulse};
  }
}

PlanarInteriorPoint::Residuals PlanarInteriorPoint::ComputeResiduals() {
  for (size_t i = 0; i < v_.size(); ++i)
    for (int k = 0; k < 3; ++k) dual_[i][k] = masses_[i][k] * (v_[i][k] - free_[i][k]);
  Residuals out{0, 0, 0};
  for (size_t c = 0; c < contacts_.size(); ++c) {
    const Contact& contact = contacts_[c];
    const Sides &s = s_[c], &z = z_[c], u = Velocity(contact, v_);
    const double n = contact.offset_n + contact.softness * (z[0] + z[1]), t = contact.friction * contact.offset_t;
    primal_[c] = {s[0] - (u[0] + (n + t)), s[1] - (u[1] + (n - t))};
    out.primal = std::max({out.primal, std::abs(primal_[c][0]), std::abs(primal_[c][1])});
    out.gap += s[0] * z[0] + s[1] * z[1];
    AddForce(contact, z, -1, &dual_);
  }
  out.dual = MassNorm(dual_);
  return out;
}

// [velocity] of a momentum residual: root mean square in the mass metric.
double PlanarInteriorPoint::MassNorm(const std::vector<Flat>& momentum) const {
  double sum = 0;
  for (size_t i = 0; i < momentum.size(); ++i)
    for (int k = 0; k < 3; ++k) sum += momentum[i][k] * momentum[i][k] / masses_[i][k];
  return std::sqrt(sum / mass_);
}

// Lower bound on the energy of all velocities that satisfy the contacts (InteriorPoint::LeastEnergy).
double PlanarInteriorPoint::LeastEnergy() {
  error_.assign(error_.size(), Flat{});
  double lack = 0, push = 0;
  for (size_t c = 0; c < contacts_.size(); ++c) {
    const Contact& contact = contacts_[c];
    if (contact.softness > 0) continue;
    const Sides& z = z_[c];
    lack -= (z[0] + z[1]) * contact.offset_n + contact.friction * (z[0] - z[1]) * contact.offset_t;
    AddForce(contact, z, 1, &error_);
  }
  for (size_t i = 0; i < error_.size(); ++i)
    for (int k = 0; k < 3; ++k) push += error_[i][k] * error_[i][k] / masses_[i][k];
  return lack <= 0 ? 0 : 0.5 * lack * lack / push;
}

void PlanarInteriorPoint::Factorise() {
  for (size_t c = 0; c < contacts_.size(); ++c) {
    const double k0 = s_[c][0] / z_[c][0], k1 = s_[c][1] / z_[c][1], r = contacts_[c].softness;
    const double inverse = 1 / (k0 * k1 + r * (k0 + k1)), mu = contacts_[c].friction;
    d_[c] = {(k1 + r) * inverse, -r * inverse, (k0 + r) * inverse};
    Matrix3& block = blocks_[c];
    // Without the cancellation of r: the sum of all four is (k0 + k1) / det.
    block(0, 0) = (k0 + k1) * inverse;
    block(1, 0) = block(0, 1) = mu * (k1 - k0) * inverse;
    block(1, 1) = mu * mu * (k0 + k1 + 4 * r) * inverse;
  }
  system_.Factorise(blocks_);
}

// With t the target: s dz + z ds = t, ds = G dv + R dz - weight r_p; then dz = D (g - G dv), g = t / z + weight r_p.
void PlanarInteriorPoint::ComputeDirection(double weight) {
  for (size_t i = 0; i < dv_.size(); ++i)
    for (int k = 0; k < 3; ++k) dv_[i][k] = -weight * dual_[i][k];
  for (size_t c = 0; c < contacts_.size(); ++c) {
    Sides& g = g_[c];
    for (int k = 0; k < 2; ++k) g[k] = target_[c][k] / z_[c][k] + weight * primal_[c][k];
    const auto& d = d_[c];
    AddForce(contacts_[c], {d[0] * g[0] + d[1] * g[1], d[1] * g[0] + d[2] * g[1]}, 1, &dv_);
  }
  system_.Solve(dv_[0].data());
  CompleteDirection(weight);
  double before = INFINITY;
  for (int i = 0; refine_to_ > 0 && i < kMaxRefinements; ++i) {
    for (size_t k = 0; k < 3 * dv_.size(); ++k) {
      const size_t body = k / 3, at = k % 3;
      error_[body][at] = masses_[body][at] * dv_[body][at] + weight * dual_[body][at];
    }
    for (size_t c = 0; c < contacts_.size(); ++c) AddForce(contacts_[c], dz_[c], -1, &error_);
    const double error = MassNorm(error_);
    if (error <= refine_to_ || error > 0.5 * before) break;
    before = error;
    system_.Solve(error_[0].data());
    for (size_t body = 0; body < dv_.size(); ++body)
      for (int k = 0; k < 3; ++k) dv_[body][k] -= error_[body][k];
    CompleteDirection(weight);
  }
}

void PlanarInteriorPoint::CompleteDirection(double weight) {
  for (size_t c = 0; c < contacts_.size(); ++c) {
    const Sides u = Velocity(contacts_[c], dv_);
    const double a = g_[c][0] - u[0], b = g_[c][1] - u[1];
    const auto& d = d_[c];
    dz_[c] = {d[0] * a + d[1] * b, d[1] * a + d[2] * b};
    const double yield = contacts_[c].softness * (dz_[c][0] + dz_[c][1]);
    for (int k = 0; k < 2; ++k) ds_[c][k] = u[k] + yield - weight * primal_[c][k];
  }
}

double PlanarInteriorPoint::LongestStep(double limit) const {
  double fastest = 1 / limit;
  for (size_t c = 0; c < contacts_.size(); ++c)
    for (int k = 0; k < 2; ++k) fastest = std::max({fastest, -ds_[c][k] / s_[c][k], -dz_[c][k] / z_[c][k]});
  return 1 / fastest;
}

Status PlanarInteriorPoint::Iterate(const Settings& settings, Solution* solution) {
  double best_merit = INFINITY;
  Residuals best{INFINITY, INFINITY, INFINITY};
  int stalled = 0;
  const double aim = settings.aim > 0 ? std::min(settings.aim, settings.tolerance) : settings.tolerance;
  double degree = 0;
  for (const Contact& contact : contacts_) degree += 2 * contact.size;
  for (;; ++solution->iterations) {
    const Residuals now = ComputeResiduals();
    const double gap = now.gap / energy_scale_;
    const double merit = std::max({gap, now.primal / kResidualShare, now.dual / kResidualShare});
    if (!std::isfinite(merit)) break;
    stalled = merit < 0.9 * best_merit ? 0 : stalled + 1;
    if (merit < best_merit) {
      best_merit = merit;
      best = {gap, now.primal, now.dual};
      best_z_ = z_;
    }
    if (merit > settings.tolerance && now.primal > settings.tolerance && LeastEnergy() > energy_limit_) {
      best = {gap, INFINITY, now.dual}, best_z_ = z_, best_merit = merit;
      break;
    }
    const int patience = best_merit <= settings.tolerance ? 3 : 15;
    if (merit <= aim || solution->iterations >= settings.max_iterations || stalled >= patience) break;
    Factorise();
    for (size_t c = 0; c < contacts_.size(); ++c)
      for (int k = 0; k < 2; ++k) target_[c][k] = -s_[c][k] * z_[c][k];
    refine_to_ = 0;
    ComputeDirection(1);
    const double sigma = std::pow(1 - LongestStep(1), 3), mu = now.gap / degree;
    const double goal = std::max(sigma * mu, kLeastShare * aim * energy_scale_ / degree);
    if (gap < kRefineBelow) refine_to_ = 0.1 * kResidualShare * aim;
    for (size_t c = 0; c < contacts_.size(); ++c)
      for (int k = 0; k < 2; ++k)
        target_[c][k] = contacts_[c].size * goal - s_[c][k] * z_[c][k] - ds_[c][k] * dz_[c][k];
    ComputeDirection(goal > sigma * mu ? 1 : 1 - sigma);
    const double step = std::min(1.0, kStepShare * LongestStep(2));
    if (!(step >= 1e-10)) break;
    for (size_t c = 0; c < contacts_.size(); ++c)
      for (int k = 0; k < 2; ++k) s_[c][k] += step * ds_[c][k], z_[c][k] += step * dz_[c][k];
    for (size_t i = 0; i < v_.size(); ++i)
      for (int k = 0; k < 3; ++k) v_[i][k] += step * dv_[i][k];
  }
  solution->gap = best.gap;
  if (best_merit <= settings.tolerance) return Status::kSolved;
  if (!std::isfinite(best_merit)) return Status::kFailed;
  return best.primal > 1e-3 ? Status::kInfeasible : Status::kInaccurate;
}

void PlanarInteriorPoint::Extract(const Problem& problem, double velocity_scale, std::span<const double> slips,
                                  std::span<const Vector3> near, Solution* solution) {
  solution->impulses.resize(contacts_.size());
  solution->slips.assign(slips.begin(), slips.end());
  solution->slips.resize(contacts_.size(), 0.0);
  for (size_t c = 0; c < contacts_.size(); ++c) {
    const Sides& z = best_z_[c];
    solution->impulses[c] =
        mean_mass_ * velocity_scale * Vector3(z[0] + z[1], contacts_[c].friction * (z[0] - z[1]), 0);
    if (!near.empty()) solution->slips[c] += softness_[c] * (solution->impulses[c][0] - near[c][0]);
  }
  VelocitiesAfter(problem, solution->impulses, &solution->velocities);
  solution->multipliers.clear();
  solution->bounce_multipliers.clear();
}

}  // namespace islet::qp
