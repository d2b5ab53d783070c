#include "qp/dense/dense_interior_point.h"

#include <algorithm>
#include <cmath>

namespace islet::qp {
namespace {

constexpr double kStepShare = 0.995;               // of the way to the boundary
constexpr double kLeastGap = 1e-15;                // per contact, scaled: nothing is gained below it
constexpr int kPatience = 15, kShortPatience = 4;  // iterations without progress; the same with a good answer in hand
constexpr double kGood = 1e-8;                     // gap and squared residual of a good answer
constexpr double kLeastSigma = 1e-5;  // lower the products would leave the range of numbers before the gap is small
constexpr int kMaxCorrectors = 2;     // centrality correctors per factorisation [Gon96]
constexpr double kCorrectorReach = 0.3, kCorrectorGain = 0.1;
constexpr double kProductLow = 0.1, kProductHigh = 10;  // centrality band
constexpr int kRefinements = 2;
constexpr double kFirstShift = 1e-15, kLastShift = 1e-12;  // of the diagonal, where the factorisation fails
constexpr double kAbsurdSpeed = 1e3;                       // times the velocities at hand

}  // namespace

// s pushed inside its cones by one unit, z the unit elements: both are of order one in scaled units, or of that of the
// velocities where contacts slide much faster than they approach.
void DenseInteriorPoint::Load(const ScaledDenseProblem& problem, Cone cone, const Eigen::VectorXd& offset) {
  gram_.Prepare(problem);
  a_ = &problem.factor;
  offset_ = offset;
  rows_.clear();
  num_rows_ = degree_ = 0;
  for (const double friction : problem.friction) {
    rows_.push_back({num_rows_, ChooseCone(friction, cone)});
    num_rows_ += NumRows(rows_.back().cone.kind);
    degree_ += Degree(rows_.back().cone.kind);
  }
  v_ = Eigen::VectorXd::Zero(a_->cols());
  for (Eigen::VectorXd* x : {&s_, &z_, &point_, &lambda_, &primal_, &target_, &ds_, &dz_}) x->setZero(num_rows_);
  eta_.assign(rows_.size(), 1.0);
  double unit[kMaxRows];
  const double size = std::max(1.0, offset_.norm() / std::sqrt(static_cast<double>(rows_.size())));
  for (size_t c = 0; c < rows_.size(); ++c) {
    const ConeKind kind = rows_[c].cone.kind;
    double* s = &s_[rows_[c].first];
    MapToRows(rows_[c].cone, offset_.segment<3>(3 * c), s);
    Identity(kind, unit);
    const double push = size + std::max(0.0, -MinEigenvalue(kind, s));
    for (int i = 0; i < NumRows(kind); ++i) {
      s[i] += push * unit[i];
      z_[rows_[c].first + i] = size * unit[i] / Degree(kind);
    }
  }
}

Eigen::VectorXd DenseInteriorPoint::Impulses(const Eigen::VectorXd& z) const {
  Eigen::VectorXd j(3 * rows_.size());
  for (size_t c = 0; c < rows_.size(); ++c) j.segment<3>(3 * c) = MapFromRows(rows_[c].cone, &z[rows_[c].first]);
  return j;
}

DenseInteriorPoint::Result DenseInteriorPoint::Solve(const ScaledDenseProblem& problem, Cone cone, int max_iterations,
                                                     const Eigen::VectorXd& offset, Eigen::VectorXd* impulses) {
  Load(problem, cone, offset);
  Result result;
  Eigen::VectorXd best_z = z_;
  double best_merit = INFINITY, rows[kMaxRows];
  int stalled = 0;
  for (;; ++result.iterations) {
    const Eigen::VectorXd u = *a_ * v_ + offset_;
    for (size_t c = 0; c < rows_.size(); ++c) {
      MapToRows(rows_[c].cone, u.segment<3>(3 * c), rows);
      for (int i = 0; i < NumRows(rows_[c].cone.kind); ++i)
        primal_[rows_[c].first + i] = s_[rows_[c].first + i] - rows[i];
    }
    dual_ = v_ - a_->transpose() * Impulses(z_);
    const double gap = s_.dot(z_), per_contact = gap / static_cast<double>(rows_.size());
    const double residual = std::max(primal_.lpNorm<Eigen::Infinity>(), dual_.lpNorm<Eigen::Infinity>());
    const double merit = std::max(per_contact, residual * residual);  // a gap of e^2 allows velocities to be off by e
    if (!std::isfinite(merit)) break;
    stalled = merit < 0.7 * best_merit ? 0 : stalled + 1;
    if (merit < best_merit) {
      best_merit = merit;
      best_z = z_;
      result.gap = per_contact, result.residual = residual;
    }
    if (per_contact < kLeastGap || stalled >= (best_merit < kGood ? kShortPatience : kPatience) ||
        result.iterations >= max_iterations)
      break;
    result.infeasible = ProveInfeasible();
    if (result.infeasible || !Factorise()) break;
    const double mu = gap / degree_;
    target_ = -lambda_;
    ComputeDirection(1);
    const double sigma = std::max(kLeastSigma, std::pow(1 - LongestStep(1), 3));
    AimAt(sigma * mu);
    ComputeDirection(1 - sigma);
    double step = std::min(1.0, kStepShare * LongestStep(2));
    for (int tries = 0; tries < kMaxCorrectors && step < 0.95; ++tries)
      if (!ImproveCentrality(1 - sigma, std::max(sigma, 1e-3) * mu, &step)) break;
    if (step < 1e-10) break;
    Advance(step);
  }
  *impulses = Impulses(best_z);
  return result;
}

// Weak duality: for impulses in the cones 0 <= j . (A v + c) <= |A^T j| |v| + j . c.
bool DenseInteriorPoint::ProveInfeasible() const {
  const Eigen::VectorXd j = Impulses(z_);
  const double lack = -j.dot(offset_), push = (a_->transpose() * j).norm();
  return lack > 0 && lack > kAbsurdSpeed * (1 + offset_.norm()) * push;
}

bool DenseInteriorPoint::Factorise() {
  weights_.resize(rows_.size());
  for (size_t c = 0; c < rows_.size(); ++c) {
    Scaling scaling = ScalingOf(c);
    if (!UpdateScaling(rows_[c].cone.kind, &s_[rows_[c].first], &z_[rows_[c].first], &scaling)) return false;
    eta_[c] = scaling.eta;
    weights_[c] = ScalingBlock(rows_[c].cone, scaling);
  }
  system_.setIdentity(a_->cols(), a_->cols());
  gram_.Add(weights_, true, &system_);
  factors_.compute(system_);
  for (double shift = kFirstShift; factors_.info() != Eigen::Success && shift <= kLastShift; shift *= 10) {
    system_.diagonal().array() +=
        shift * system_.diagonal().maxCoeff();  // the rounding of large entries hides the unit matrix
    factors_.compute(system_);
  }
  return factors_.info() == Eigen::Success;
}

// dv - A^T dj = -weight (v - A^T j), T A dv - ds = weight (s - T u), and ds + dz = target in scaled space. The scalings span
// so many orders of magnitude that the first line has to be put right by refinement.
void DenseInteriorPoint::ComputeDirection(double weight) {
  double a[kMaxRows], b[kMaxRows];
  const auto complete = [&] {
    const Eigen::VectorXd du = *a_ * dv_;
    for (size_t c = 0; c < rows_.size(); ++c) {
      const int first = rows_[c].first, d = NumRows(rows_[c].cone.kind);
      MapToRows(rows_[c].cone, du.segment<3>(3 * c), a);
      for (int i = 0; i < d; ++i) a[i] -= weight * primal_[first + i];
      ApplyInverseScaling(rows_[c].cone.kind, ScalingOf(c), a, &ds_[first]);
      for (int i = 0; i < d; ++i) dz_[first + i] = target_[first + i] - ds_[first + i];
    }
  };
  dv_.setZero(a_->cols());
  Eigen::VectorXd dj(3 * rows_.size());
  double before = INFINITY;
  for (int pass = 0; pass <= kRefinements; ++pass) {
    complete();
    for (size_t c = 0; c < rows_.size(); ++c) {
      ApplyInverseScaling(rows_[c].cone.kind, ScalingOf(c), &dz_[rows_[c].first], b);
      dj.segment<3>(3 * c) = MapFromRows(rows_[c].cone, b);
    }
    const Eigen::VectorXd error = a_->transpose() * dj - dv_ - weight * dual_;
    const double size = error.lpNorm<Eigen::Infinity>();
    if (pass > 0 && !(size < 0.5 * before)) break;
    before = size;
    dv_ += factors_.solve(error);
  }
  complete();
}

void DenseInteriorPoint::AimAt(double goal) {
  for (const auto& [first, cone] : rows_)
    AimAtCentre(cone.kind, &lambda_[first], &ds_[first], &dz_[first], goal, 1, &target_[first]);
}

bool DenseInteriorPoint::ImproveCentrality(double weight, double aim, double* step) {
  const double reach = std::min(1.0, *step + kCorrectorReach);
  const Eigen::VectorXd target = target_, dv = dv_, ds = ds_, dz = dz_;
  for (const auto& [first, cone] : rows_)
    CorrectCentrality(cone.kind, &lambda_[first], &ds_[first], &dz_[first], reach, kProductLow * aim,
                      kProductHigh * aim, &target_[first]);
  ComputeDirection(weight);
  const double longer = std::min(1.0, kStepShare * LongestStep(2));
  if (longer >= *step + kCorrectorGain * (reach - *step)) {
    *step = longer;
    return true;
  }
  target_ = target, dv_ = dv, ds_ = ds, dz_ = dz;
  return false;
}

double DenseInteriorPoint::LongestStep(double limit) const {
  double step = limit;
  for (const Rows& rows : rows_) {
    step = MaxStep(rows.cone.kind, &lambda_[rows.first], &ds_[rows.first], step);
    step = MaxStep(rows.cone.kind, &lambda_[rows.first], &dz_[rows.first], step);
  }
  return step;
}

void DenseInteriorPoint::Advance(double step) {
  double move[kMaxRows];
  v_ += step * dv_;
  for (size_t c = 0; c < rows_.size(); ++c) {
    const int first = rows_[c].first, d = NumRows(rows_[c].cone.kind);
    ApplyScaling(rows_[c].cone.kind, ScalingOf(c), &ds_[first], move);
    for (int i = 0; i < d; ++i) s_[first + i] += step * move[i];
    ApplyInverseScaling(rows_[c].cone.kind, ScalingOf(c), &dz_[first], move);
    for (int i = 0; i < d; ++i) z_[first + i] += step * move[i];
  }
}

}  // namespace islet::qp
