#include "qp/interior_point/interior_point.h"

#include <algorithm>
#include <cmath>

#include "parallel/fork.h"
#include "qp/body_algebra.h"
#include "qp/smallness.h"

namespace islet::qp {
namespace {

constexpr double kStartPush = 0.2;  // of v_ref: how far inside its cone a row starts
constexpr double kStartImpulse =
    5;  // times what would stop one v_ref at the contact alone: piles press more than single bodies
// Beyond kAlmost on the way to an aim below the tolerance, where affine steps reach farther than that: all contacts clearly stick,
// slide or part, and the gap falls by what a step leaves of the way.
constexpr double kMostShare = 0.9999;
// On the way to an aim far below the tolerance: lower, some contacts run ahead of others and the matrix out of the range of
// numbers. Elsewhere the last step may go as far as it can.
constexpr double kLeastSigma = 1e-3;
constexpr double kLeastShare = 0.1;  // of the aim: least mean complementarity
constexpr int kMaxCorrectors = 3;    // centrality correctors per factorisation [Gon96]
constexpr double kProductLow = 0.1;  // centrality band, times the target of mu, and 1 over it
constexpr int kSpare = 2;            // numbers at the end of y, which whole vectors reach

// bound: 1 / the longest step.
double LongestStep(double bound, double limit) { return bound * limit > 1 ? 1 / bound : limit; }

}  // namespace

void InteriorPoint::Solve(const Problem& problem, const Settings& settings, std::span<const double> slips,
                          Solution* solution) {
  Load(problem, settings, slips);
  ChooseStart();
  solution->iterations = 0;
  solution->status = Iterate(settings, solution);
  Extract(problem, settings.velocity_scale, slips, solution);
}

void InteriorPoint::Load(const Problem& problem, const Settings& settings, std::span<const double> slips) {
  const int nb = problem.num_bodies(), nc = problem.num_contacts();
  scaled_.bodies.assign(problem.bodies.begin(), problem.bodies.end());
  scaled_.contacts.assign(problem.contacts.begin(), problem.contacts.end());
  mean_mass_ = 0;
  for (const BodyTerm& body : problem.bodies) mean_mass_ += body.mass / nb;
  const double per_velocity = 1 / settings.velocity_scale;
  energy_scale_ = 0;
  for (BodyTerm& body : scaled_.bodies) {
    body.mass /= mean_mass_;
    body.inertia /= mean_mass_;
    body.inverse_inertia *= mean_mass_;
    body.velocity *= per_velocity;
    energy_scale_ += 0.5 * body.mass + 0.5 * body.velocity.dot(MassTimes(body, body.velocity));
  }
  energy_limit_ = std::isfinite(settings.energy_limit)
                      ? settings.energy_limit * per_velocity * per_velocity / mean_mass_
                      : 1e6 * energy_scale_;
  bool bounces = false;
  for (ContactTerm& contact : scaled_.contacts) {
    contact.drift *= per_velocity;
    contact.target *= per_velocity;
    contact.compliance *= mean_mass_;
    bounces = bounces || contact.target > 0;
  }
  const bool kinetic = settings.model == Model::kKinetic && bounces;
  rows_.clear();
  degree_ = 0;
  batches_.Clear();
  for (int c = 0; c < nc; ++c) {
    const ContactTerm& contact = scaled_.contacts[c];
    Vector3 offset = contact.drift;
    if (!slips.empty()) offset[0] += slips[c] * per_velocity;
    if (!kinetic) offset[0] -= contact.target;
    AddRows({c, kinetic ? 1 : 0, ChooseCone(contact.friction, settings.cone), offset, contact.compliance, {}});
  }
  for (int c = 0; kinetic && c < nc; ++c) {
    const ContactTerm& contact = scaled_.contacts[c];
    AddRows({c, 0, {ConeKind::kRay, 0}, contact.drift - Vector3(contact.target, 0, 0), 0.0, {}});
  }
  kkt_.Prepare(scaled_, kinetic ? 2 : 1);
  PlaceRows();
}

void InteriorPoint::AddRows(const Rows& rows) {
  rows_.push_back(rows);
  rows_.back().place =
      batches_.Add({scaled_.contacts[rows.contact], rows.contact, rows.cone, rows.offset, rows.compliance, rows.field});
  degree_ += Degree(rows.cone.kind);
}

void InteriorPoint::PlaceRows() {
  const int nb = scaled_.num_bodies(), nc = scaled_.num_contacts();
  const size_t rows = batches_.num_rows(), batches = batches_.size();
  batches_.Finish(scaled_, kkt_.num_fields());
  for (auto* v : {&s_, &z_}) batches_.FillWithUnits(v);
  for (auto* v : {&point_, &inverse_, &lambda_, &primal_}) v->assign(rows, Lanes{});
  const size_t unknowns = static_cast<size_t>(6) * kkt_.num_fields() * nb;
  for (Direction* d : {&direction_, &trial_}) {
    for (auto* v : {&d->target, &d->ds, &d->dz, &d->plain}) v->assign(rows, Lanes{});
    d->constants.resize(3 * batches);
    d->dy.assign(unknowns + kSpare, 0.0);
  }
  forces_.resize(3 * batches);
  softening_.resize(9 * batches);
  scaling_blocks_.resize(9 * batches);
  y_.assign(unknowns + kSpare, 0.0);
  error_.assign(unknowns + kSpare, 0.0);
  dual_.assign(unknowns, 0.0);
  gathered_.resize(unknowns);
  blocks_.resize(nc);
  normal_blocks_.resize(nc);
}

// Velocities as they are, contact rows pushed inside their cones, impulses from what each contact would need alone.
void InteriorPoint::ChooseStart() {
  const int fields = kkt_.num_fields(), stride = 6 * fields;
  for (int i = 0; i < scaled_.num_bodies(); ++i)
    for (int f = 0; f < fields; ++f) At(y_, stride * i + 6 * f) = scaled_.bodies[i].velocity;
  double unit[kMaxRows], s[kMaxRows];
  for (Rows& rows : rows_) {
    const ContactTerm& contact = scaled_.contacts[rows.contact];
    const Matrix3 delassus = DelassusBlock(scaled_, contact);
    rows.rho = 3 / delassus.trace();
    MapToRows(rows.cone, FieldVelocity(contact, stride, rows.field, y_) + rows.offset, s);
    Identity(rows.cone.kind, unit);
    const double push = kStartPush + std::max(0.0, -MinEigenvalue(rows.cone.kind, s));
    const double impulse = kStartImpulse / delassus(0, 0) / Degree(rows.cone.kind);
    for (int i = 0; i < NumRows(rows.cone.kind); ++i) {
      s_[rows.place.first + i].at[rows.place.lane] = s[i] + push * unit[i];
      z_[rows.place.first + i].at[rows.place.lane] = impulse * unit[i];
    }
  }
}

Status InteriorPoint::Iterate(const Settings& settings, Solution* solution) {
  double best_merit = INFINITY;
  best_z_ = z_, best_y_ = y_;  // of this problem, if no residual is finite
  Residuals best{INFINITY, INFINITY, INFINITY};
  bool solved = false;
  int stalled = 0;
  // Where all contacts clearly stick, slide or part, answers are near long before a gap of the aim, and their natural map says so:
  // kRefined of v_ref (rms) is enough. It falls at most as fast as the gap, which tells when to look again.
  double look_below = HasNaturalMap() ? kRefined : 0;  // merit
  const double tolerance = settings.gap_tolerance(),
               aim = settings.aim > 0 ? std::min(settings.aim, tolerance) : tolerance;
  const double least_sigma = aim < tolerance ? kLeastSigma : 0;
  const double motion = 0.5 * scaled_.num_bodies();  // kinetic energy at v_ref
  for (;; ++solution->iterations) {
    const Residuals now = ComputeResiduals();
    const double gap = now.gap / energy_scale_, residual = std::max(now.primal, now.dual);
    double merit = std::max(gap, residual);
    if (!std::isfinite(merit)) break;
    // Among solved points that which is nearest to the answer counts: a residual e moves velocities by e, a gap by its root. If
    // they weighed the same the search would end when the residuals reach rounding, with a gap that can still fall far.
    if (merit <= tolerance) {
      merit = std::max(now.gap / motion, residual * residual);
      if (!solved) solved = true, best_merit = INFINITY;
    } else if (solved) {
      merit = INFINITY;
    }
    stalled = merit < 0.9 * best_merit ? 0 : stalled + 1;
    if (merit < best_merit) {
      best_merit = merit;
      best = {gap, now.primal, now.dual};
      best_z_ = z_, best_y_ = y_;
    }
    if (!solved && now.primal > tolerance && LeastEnergy() > energy_limit_) {
      best = {gap, INFINITY, now.dual}, best_z_ = z_, best_y_ = y_;
      break;
    }
    bool there = solved && (aim >= tolerance || merit <= aim);
    if (solved && !there && merit == best_merit && merit <= look_below && now.dual <= kRefined) {
      const double map = NaturalMap();
      there = map <= kRefined;
      look_below = merit * kRefined / map;
    }
    if (there || stalled >= kPatience) break;
    if (!UpdateScalings()) break;
    kkt_.Factorise(blocks_, normal_blocks_);
    ComputeDirection(1, false, &direction_);
    const double mu = now.gap / degree_;
    const bool refine = gap < std::sqrt(tolerance);  // half the digits are there
    refine_to_ = 0.1 * std::min(tolerance, std::sqrt(aim));
    const double affine = LongestStep(direction_.bound, 1);
    const double left = 1 - affine, sigma = std::max(least_sigma, left * left * left);  // [Meh92]
    // Complementarity is not driven far below the aim: the scalings would span more orders of magnitude than numbers hold,
    // and what is left of the residuals could no longer be removed.
    const double least = kLeastShare * aim * (aim < tolerance ? motion : energy_scale_) / degree_;
    const double goal = std::max(sigma * mu, least);
    const double weight = goal > sigma * mu ? 1 : 1 - sigma;
    const double share = least_sigma > 0 ? std::clamp(affine, kAlmost, kMostShare) : kAlmost;
    AimAt(goal);
    ComputeDirection(weight, refine, &direction_);
    double step = std::min(1.0, share * LongestStep(direction_.bound, 2));
    for (int tries = 0; tries < kMaxCorrectors && step < 0.95; ++tries) {
      if (!ImproveCentrality(weight, std::max(goal, 1e-3 * mu), refine, &step)) break;
    }
    if (step < 1e-10) break;
    Advance(step);
  }
  solution->gap = best.gap;
  z_ = best_z_, y_ = best_y_;
  if (solved) return Status::kSolved;
  if (!std::isfinite(best_merit)) return Status::kFailed;
  return best.primal > 1e-3 ? Status::kInfeasible : Status::kInaccurate;
}

// Lower bound on the kinetic energy of all velocities that satisfy the contacts, by weak duality: for z in the dual cone
// 0 <= z . (A v + c) <= |A^T z| |v| + z . c in the mass metric and its dual.
double InteriorPoint::LeastEnergy() {
  const int stride = 6 * kkt_.num_fields();
  double lack = 0;
  for (const Rows& rows : rows_) {
    if (rows.field == 0 && rows.compliance == 0) lack -= ImpulseAt(rows.cone, z_, rows.place).dot(rows.offset);
  }
  if (lack <= 0) return 0;
  std::fill(error_.begin(), error_.end(), 0.0);
  for (const Rows& rows : rows_) {
    if (rows.field > 0 || rows.compliance > 0) continue;
    AddForce(scaled_.contacts[rows.contact], stride, 0, 1, ImpulseAt(rows.cone, z_, rows.place), &error_);
  }
  double push = 0;
  for (int i = 0; i < scaled_.num_bodies(); ++i) {
    const Vector6 force = At(error_, stride * i);
    push += force.dot(InverseMassTimes(scaled_.bodies[i], force));
  }
  return 0.5 * lack * lack / push;
}

// One centrality corrector: look where the whole step would lead, pull the products that leave the band back into it,
// and keep the new direction if it can be followed farther.                                                     [Gon96]
bool InteriorPoint::ImproveCentrality(double weight, double aim, bool refine, double* step) {
  ForBatches([&](int first, int last) {
    kernels_->centre(Arrays(), direction_.View(), trial_.View(), first, last, kProductLow * aim, aim / kProductLow);
  });
  ComputeDirection(weight, refine, &trial_);
  const double longer = std::min(1.0, kAlmost * LongestStep(trial_.bound, 2));
  if (longer <= *step) return false;
  *step = longer;
  std::swap(direction_, trial_);
  return true;
}

void InteriorPoint::Extract(const Problem& problem, double velocity_scale, std::span<const double> slips,
                            Solution* solution) {
  const int nb = problem.num_bodies(), nc = problem.num_contacts();
  solution->velocities.resize(static_cast<size_t>(6) * nb);
  for (int i = 0; i < nb; ++i) At(solution->velocities, 6 * i) = problem.bodies[i].velocity;
  solution->impulses.resize(nc);
  solution->slips.assign(slips.begin(), slips.end());
  solution->slips.resize(nc, 0.0);
  for (int c = 0; c < nc; ++c) {
    solution->impulses[c] = mean_mass_ * velocity_scale * ImpulseAt(rows_[c].cone, z_, rows_[c].place);
    ApplyImpulse(problem, problem.contacts[c], solution->impulses[c], solution->velocities.data());
  }
  solution->multipliers.clear();
  solution->bounce_multipliers.clear();
  if (kkt_.num_fields() == 1) return;
  for (int c = 0; c < nc; ++c)
    solution->bounce_multipliers.push_back(mean_mass_ * velocity_scale *
                                           ImpulseAt(rows_[nc + c].cone, z_, rows_[nc + c].place)[0]);
  // p from the answer's own v and gamma, so that M (v - p) = N^T gamma holds to rounding.
  solution->multipliers = solution->velocities;
  for (int c = 0; c < nc; ++c)
    ApplyImpulse(problem, problem.contacts[c], {-solution->bounce_multipliers[c], 0, 0}, solution->multipliers.data());
}

const char* ToString(Status status) {
  switch (status) {
    case Status::kSolved:
      return "solved";
    case Status::kInaccurate:
      return "inaccurate";
    case Status::kInfeasible:
      return "infeasible";
    case Status::kFailed:
      return "failed";
  }
  return "unknown";
}

}  // namespace islet::qp
