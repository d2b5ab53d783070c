#include "bench/studies/reference_interior_point.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "bench/studies/lorentz_cone.h"
#include "bench/studies/study_csv.h"

#ifdef ISLET_HAVE_CHOLMOD

#include <cholmod.h>
#include <dlfcn.h>
extern "C" void openblas_set_num_threads(int);

namespace islet::studies {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using lorentz::Matrix3;
using lorentz::Vector3;

constexpr double kMostEntries = 3e7;    // of all contacts' blocks: more is not worth the memory
constexpr double kStepShare = 0.99;     // of the way to the boundary
constexpr double kLeastStep = 1e-8;     // shorter steps make no progress
constexpr int kRefinements = 2;         // of a direction
constexpr double kGapPerSquare = 1e-2;  // complementarity over tolerance^2
constexpr double kResidualShare = 0.1;  // residuals over the tolerance

void UseOneThread() {
  // CHOLMOD 3 opens OpenMP regions of four threads, whatever OMP_NUM_THREADS says; zero active levels keep them in this one.
  using Setter = void (*)(int);
  if (const auto set = reinterpret_cast<Setter>(dlsym(RTLD_DEFAULT, "omp_set_max_active_levels"))) set(0);
  openblas_set_num_threads(1);
}

// Unknowns that a contact couples to, and its scaled rows: G_c^T = H_c diag(1, mu, mu) d.
struct ContactRows {
  std::vector<int> unknowns;
  MatrixXd transposed;      // unknowns x 3
  std::vector<int> places;  // of the lower triangle's entries, column by column, in the condensed matrix
};

// M + sum G_c^T D_c G_c, its pattern, and its factor.
class Condensed {
 public:
  Condensed(const SparseMatrix& mass, std::vector<ContactRows>* rows) {
    UseOneThread();
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SUPERNODAL, common_.print = 0;
    MakePattern(mass, rows);
    view_.nrow = view_.ncol = static_cast<size_t>(lower_.rows());
    view_.nzmax = static_cast<size_t>(lower_.nonZeros());
    view_.p = lower_.outerIndexPtr(), view_.i = lower_.innerIndexPtr(), view_.x = lower_.valuePtr();
    view_.stype = -1, view_.itype = CHOLMOD_INT, view_.xtype = CHOLMOD_REAL, view_.dtype = CHOLMOD_DOUBLE;
    view_.sorted = view_.packed = 1;
    factor_ = cholmod_analyze(&view_, &common_);
  }
  ~Condensed() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_free_dense(&solution_, &common_);
    cholmod_free_dense(&work_y_, &common_);
    cholmod_free_dense(&work_e_, &common_);
    cholmod_finish(&common_);
  }
  Condensed(const Condensed&) = delete;
  Condensed& operator=(const Condensed&) = delete;

  bool Factorise(const std::vector<ContactRows>& rows, const std::vector<Matrix3>& weights) {
    double* values = lower_.valuePtr();
    std::copy(mass_values_.begin(), mass_values_.end(), values);
    for (size_t c = 0; c < rows.size(); ++c) {
      const MatrixXd& g = rows[c].transposed;
      weighted_.noalias() = g * weights[c];
      size_t place = 0;
      for (Eigen::Index j = 0; j < g.rows(); ++j)
        for (Eigen::Index i = j; i < g.rows(); ++i) values[rows[c].places[place++]] += weighted_.row(i).dot(g.row(j));
    }
    return cholmod_factorize(&view_, factor_, &common_) != 0 && common_.status == CHOLMOD_OK;
  }

  VectorXd Solve(VectorXd right) {
    cholmod_dense b{};
    b.nrow = b.nzmax = b.d = static_cast<size_t>(right.size());
    b.ncol = 1, b.x = right.data(), b.xtype = CHOLMOD_REAL, b.dtype = CHOLMOD_DOUBLE;
    cholmod_solve2(CHOLMOD_A, factor_, &b, nullptr, &solution_, nullptr, &work_y_, &work_e_, &common_);
    return Eigen::Map<const VectorXd>(static_cast<const double*>(solution_->x), right.size());
  }

 private:
  void MakePattern(const SparseMatrix& mass, std::vector<ContactRows>* rows) {
    std::vector<Eigen::Triplet<double>> entries;
    for (int k = 0; k < mass.outerSize(); ++k)
      for (SparseMatrix::InnerIterator e(mass, k); e; ++e)
        if (e.row() >= e.col()) entries.emplace_back(static_cast<int>(e.row()), static_cast<int>(e.col()), e.value());
    for (const ContactRows& r : *rows)
      for (size_t j = 0; j < r.unknowns.size(); ++j)
        for (size_t i = j; i < r.unknowns.size(); ++i) entries.emplace_back(r.unknowns[i], r.unknowns[j], 0.0);
    lower_.resize(mass.rows(), mass.cols());
    lower_.setFromTriplets(entries.begin(), entries.end());
    mass_values_.assign(lower_.valuePtr(), lower_.valuePtr() + lower_.nonZeros());
    const int* starts = lower_.outerIndexPtr();
    const int* indices = lower_.innerIndexPtr();
    for (ContactRows& r : *rows)
      for (size_t j = 0; j < r.unknowns.size(); ++j)
        for (size_t i = j; i < r.unknowns.size(); ++i) {
          const int column = r.unknowns[j];
          r.places.push_back(static_cast<int>(
              std::lower_bound(indices + starts[column], indices + starts[column + 1], r.unknowns[i]) - indices));
        }
  }

  Eigen::SparseMatrix<double, Eigen::ColMajor, int> lower_;
  std::vector<double> mass_values_;
  MatrixXd weighted_;
  cholmod_common common_{};
  cholmod_sparse view_{};
  cholmod_factor* factor_ = nullptr;
  cholmod_dense *solution_ = nullptr, *work_y_ = nullptr, *work_e_ = nullptr;
};

class InteriorPoint {
 public:
  explicit InteriorPoint(const GeneralProblem& problem) : problem_(problem), m_(problem.num_contacts()) {
    MakeRows();
    condensed_ = std::make_unique<Condensed>(problem.mass, &rows_);
  }

  GeneralAnswer Run(const ReferenceLimits& limits) {
    const StudyClock clock;
    GeneralAnswer answer;
    if (!Start()) return answer;
    for (answer.iterations = 1; answer.iterations < limits.iterations; ++answer.iterations) {
      Residuals();
      answer.solved =
          Gap() <= kGapPerSquare * limits.tolerance * limits.tolerance && Worst() <= kResidualShare * limits.tolerance;
      Keep();
      if (answer.solved || clock.Wall() > limits.seconds || !Iterate()) break;
    }
    v_ = best_v_, z_ = best_z_;
    answer.v = unit_ * v_;
    answer.j.resize(3 * m_);
    for (int c = 0; c < m_; ++c) answer.j.segment<3>(3 * c) = unit_ * scale_[c] * Stretch(c).cwiseProduct(z_[c]);
    return answer;
  }

 private:
  Vector3 Stretch(int c) const { return {1, problem_.friction[c], problem_.friction[c]}; }

  void MakeRows() {
    const SparseMatrix& h = problem_.coupling;
    const VectorXd masses = problem_.mass.diagonal();
    const VectorXd free = h.transpose() * problem_.load.cwiseQuotient(masses) + problem_.drift;
    rows_.resize(m_), scale_.resize(m_), shift_.resize(m_);
    unit_ = 0;
    for (int c = 0; c < m_; ++c) {
      ContactRows& r = rows_[c];
      double trace = 0;
      for (int k = 0; k < 3; ++k)
        for (SparseMatrix::InnerIterator e(h, 3 * c + k); e; ++e) {
          trace += e.value() * e.value() / masses[e.row()];
          r.unknowns.push_back(static_cast<int>(e.row()));
        }
      std::sort(r.unknowns.begin(), r.unknowns.end());
      r.unknowns.erase(std::unique(r.unknowns.begin(), r.unknowns.end()), r.unknowns.end());
      scale_[c] = trace > 0 ? std::sqrt(3 / trace) : 1;
      r.transposed.setZero(static_cast<Eigen::Index>(r.unknowns.size()), 3);
      for (int k = 0; k < 3; ++k)
        for (SparseMatrix::InnerIterator e(h, 3 * c + k); e; ++e) {
          const auto at = std::lower_bound(r.unknowns.begin(), r.unknowns.end(), static_cast<int>(e.row()));
          r.transposed(at - r.unknowns.begin(), k) = scale_[c] * Stretch(c)[k] * e.value();
        }
      unit_ = std::max(unit_, scale_[c] * free.segment<3>(3 * c).norm());
    }
    if (unit_ == 0) unit_ = 1;
    load_ = problem_.load / unit_;
    for (int c = 0; c < m_; ++c)
      shift_[c] = scale_[c] / unit_ * Stretch(c).cwiseProduct(problem_.drift.segment<3>(3 * c));
  }

  Vector3 Rows(int c, const VectorXd& v) const {
    const ContactRows& r = rows_[c];
    Vector3 out = Vector3::Zero();
    for (size_t i = 0; i < r.unknowns.size(); ++i)
      out += v[r.unknowns[i]] * r.transposed.row(static_cast<int>(i)).transpose();
    return out;
  }
  void AddTransposed(int c, const Vector3& x, VectorXd* out) const {
    const ContactRows& r = rows_[c];
    for (size_t i = 0; i < r.unknowns.size(); ++i)
      (*out)[r.unknowns[i]] += r.transposed.row(static_cast<int>(i)).dot(x);
  }

  static void MoveInside(std::vector<Vector3>* x) {
    double outside = -1e300;
    for (const Vector3& p : *x) outside = std::max(outside, p.tail<2>().norm() - p[0]);
    if (outside < -1e-3) return;
    for (Vector3& p : *x) p[0] += 1 + outside;
  }

  // Least 1/2 v^T M v - f^T v + 1/2 |G v + h|^2, then both sides are moved into their cones.
  bool Start() {
    s_.resize(m_), z_.resize(m_), lambda_.resize(m_);
    if (!condensed_->Factorise(rows_, std::vector<Matrix3>(m_, Matrix3::Identity()))) return false;
    VectorXd right = load_;
    for (int c = 0; c < m_; ++c) AddTransposed(c, -shift_[c], &right);
    v_ = condensed_->Solve(right);
    for (int c = 0; c < m_; ++c) {
      s_[c] = Rows(c, v_) + shift_[c];
      z_[c] = -s_[c];
    }
    MoveInside(&s_);
    MoveInside(&z_);
    return v_.allFinite();
  }

  void Residuals() {
    dual_residual_ = problem_.mass * v_ - load_;
    primal_residual_.resize(m_);
    for (int c = 0; c < m_; ++c) {
      AddTransposed(c, -z_[c], &dual_residual_);
      primal_residual_[c] = s_[c] - Rows(c, v_) - shift_[c];
    }
  }
  double Gap() const {
    double sum = 0;
    for (int c = 0; c < m_; ++c) sum += s_[c].dot(z_[c]);
    return sum / m_;
  }
  double Worst() const {
    double worst = dual_residual_.cwiseQuotient(problem_.mass.diagonal()).cwiseAbs().maxCoeff();
    for (const Vector3& r : primal_residual_) worst = std::max(worst, r.norm());
    return worst;
  }

  // The point with the least complementarity and residual so far: towards the end rounding wins.
  void Keep() {
    const double merit = std::max(std::sqrt(std::max(0.0, Gap())), Worst());
    if (!(merit < best_merit_)) return;
    best_merit_ = merit, best_v_ = v_, best_z_ = z_;
  }

  // M dv - G^T dz = dual, G dv + W^2 dz = cone: condensed on dv.
  void SolveCondensed(const VectorXd& dual, const std::vector<Vector3>& cone, VectorXd* dv, std::vector<Vector3>* dz) {
    VectorXd right = dual;
    for (int c = 0; c < m_; ++c) AddTransposed(c, scalings_[c].InverseTwice(cone[c]), &right);
    *dv = condensed_->Solve(right);
    dz->resize(m_);
    for (int c = 0; c < m_; ++c) (*dz)[c] = scalings_[c].InverseTwice(cone[c] - Rows(c, *dv));
  }

  // The direction in which W^-1 ds + W dz = target. Refined on the whole system: where a contact slides, W^-2 is so large that
  // the condensed one alone leaves half of the digits.
  void Direction(const std::vector<Vector3>& target) {
    std::vector<Vector3> cone(m_), cone_left(m_), dz_change;
    for (int c = 0; c < m_; ++c) cone[c] = scalings_[c].w * target[c] + primal_residual_[c];
    SolveCondensed(-dual_residual_, cone, &dv_, &dz_);
    for (int refinement = 0; refinement < kRefinements; ++refinement) {
      VectorXd dual_left = -dual_residual_ - problem_.mass * dv_, dv_change;
      for (int c = 0; c < m_; ++c) {
        AddTransposed(c, dz_[c], &dual_left);
        cone_left[c] = cone[c] - Rows(c, dv_) - scalings_[c].w * (scalings_[c].w * dz_[c]);
      }
      SolveCondensed(dual_left, cone_left, &dv_change, &dz_change);
      dv_ += dv_change;
      for (int c = 0; c < m_; ++c) dz_[c] += dz_change[c];
    }
    ds_.resize(m_);
    for (int c = 0; c < m_; ++c) ds_[c] = Rows(c, dv_) - primal_residual_[c];
  }
  double StepLength() const {
    double step = 1 / kStepShare;
    for (int c = 0; c < m_; ++c)
      step = std::min({step, lorentz::StepToBoundary(s_[c], ds_[c]), lorentz::StepToBoundary(z_[c], dz_[c])});
    return std::min(1.0, kStepShare * step);
  }

  bool Iterate() {
    scalings_.clear();
    std::vector<Matrix3> weights(m_);
    for (int c = 0; c < m_; ++c) {
      scalings_.emplace_back(s_[c], z_[c]);
      weights[c] = scalings_[c].inverse_squared;
      lambda_[c] = scalings_[c].w * z_[c];
    }
    if (!std::all_of(weights.begin(), weights.end(), [](const Matrix3& w) { return w.allFinite(); })) return false;
    if (!condensed_->Factorise(rows_, weights)) return false;
    std::vector<Vector3> target(m_);
    for (int c = 0; c < m_; ++c) target[c] = -lambda_[c];
    Direction(target);
    const double predicted = StepLength(), centring = std::pow(1 - predicted, 3), gap = Gap();
    for (int c = 0; c < m_; ++c) {
      Vector3 d = -lorentz::Product(lambda_[c], lambda_[c]) -
                  lorentz::Product(scalings_[c].inverse * ds_[c], scalings_[c].w * dz_[c]);
      d[0] += centring * gap;
      target[c] = lorentz::Quotient(d, lambda_[c]);
    }
    Direction(target);
    const double step = StepLength();
    if (!(step > kLeastStep) || !dv_.allFinite()) return false;
    v_ += step * dv_;
    for (int c = 0; c < m_; ++c) {
      s_[c] += step * ds_[c];
      z_[c] += step * dz_[c];
    }
    return std::all_of(s_.begin(), s_.end(), [](const Vector3& x) { return lorentz::Determinant(x) > 0; }) &&
           std::all_of(z_.begin(), z_.end(), [](const Vector3& x) { return lorentz::Determinant(x) > 0; });
  }

  const GeneralProblem& problem_;
  int m_;
  double unit_ = 1;
  std::vector<ContactRows> rows_;
  std::vector<double> scale_;
  std::vector<Vector3> shift_;  // h
  VectorXd load_;
  std::unique_ptr<Condensed> condensed_;
  VectorXd v_, dv_, dual_residual_;
  std::vector<Vector3> s_, z_, lambda_, ds_, dz_, primal_residual_;
  std::vector<lorentz::Scaling> scalings_;
  double best_merit_ = 1e300;
  VectorXd best_v_;
  std::vector<Vector3> best_z_;
};

}  // namespace

bool ReferenceAvailable() { return true; }

std::string ReferenceVersion() {
  int version[3] = {};
  cholmod_version(version);
  return "cholmod " + std::to_string(version[0]) + '.' + std::to_string(version[1]) + '.' + std::to_string(version[2]);
}

bool FitsReference(const GeneralProblem& problem) {
  double entries = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const double unknowns = static_cast<double>(problem.coupling.col(3 * c).nonZeros());
    entries += unknowns * unknowns / 2;
  }
  return entries <= kMostEntries;
}

GeneralAnswer SolveByReference(const GeneralProblem& problem, const ReferenceLimits& limits) {
  return InteriorPoint(problem).Run(limits);
}

}  // namespace islet::studies

#else

namespace islet::studies {

bool ReferenceAvailable() { return false; }
std::string ReferenceVersion() { return "no CHOLMOD"; }
bool FitsReference(const GeneralProblem&) { return false; }
GeneralAnswer SolveByReference(const GeneralProblem&, const ReferenceLimits&) { return {}; }

}  // namespace islet::studies

#endif
