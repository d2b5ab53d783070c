#include "bench/studies/ipopt_solver.h"

#include <algorithm>
#include <cmath>
#include <vector>

#ifdef ISLET_HAVE_IPOPT

#include <IpIpoptApplication.hpp>
#include <IpSolveStatistics.hpp>
#include <IpTNLP.hpp>

namespace islet::studies {
namespace {

using Eigen::VectorXd;
using Ipopt::Index;
using Ipopt::Number;

constexpr double kInfinite = 2e19;  // what IPOPT takes for infinity
constexpr double kLeastTolerance = 1e-13;

// Entries of a sparse matrix, as IPOPT asks for them: first the places (`values` null), then the values in the same order.
struct Table {
  Index *row, *column;
  Number* values;
  int entries = 0;
  void operator()(Eigen::Index i, Eigen::Index j, double value) {
    if (values == nullptr)
      row[entries] = static_cast<Index>(i), column[entries] = static_cast<Index>(j);
    else
      values[entries] = value;
    ++entries;
  }
};

// Rows: n equalities, then one cone a contact. Columns: v, then j in blocks of three.
class ContactProgram final : public Ipopt::TNLP {
 public:
  ContactProgram(const GeneralProblem& problem, GeneralAnswer* answer) : p_(problem), answer_(answer) {
    n_ = p_.num_unknowns(), m_ = p_.num_contacts();
    const VectorXd masses = p_.mass.diagonal();
    const VectorXd free = p_.coupling.transpose() * p_.load.cwiseQuotient(masses) + p_.drift;
    coupling_ = p_.coupling;
    scale_.resize(m_);
    double unit = 0;
    for (int c = 0; c < m_; ++c) {
      double trace = 0;
      for (int k = 0; k < 3; ++k)
        for (SparseMatrix::InnerIterator e(coupling_, 3 * c + k); e; ++e)
          trace += e.value() * e.value() / masses[e.row()];
      scale_[c] = trace > 0 ? std::sqrt(3 / trace) : 1;
      for (int k = 0; k < 3; ++k) coupling_.col(3 * c + k) *= scale_[c];
      unit = std::max(unit, scale_[c] * free.segment<3>(3 * c).norm());
    }
    unit_ = unit > 0 ? unit : 1;
    load_ = p_.load / unit_;
    drift_.resize(3 * m_);
    for (int c = 0; c < m_; ++c) drift_.segment<3>(3 * c) = scale_[c] / unit_ * p_.drift.segment<3>(3 * c);
    start_ = load_.cwiseQuotient(masses);
  }

  bool get_nlp_info(Index& n, Index& m, Index& jacobian, Index& hessian, IndexStyleEnum& style) override {
    n = n_ + 3 * m_, m = n_ + m_;
    jacobian = static_cast<Index>(p_.mass.nonZeros() + coupling_.nonZeros()) + 3 * m_;
    hessian = 3 * m_;
    for (int k = 0; k < p_.mass.outerSize(); ++k)
      for (SparseMatrix::InnerIterator e(p_.mass, k); e; ++e) hessian += e.row() >= e.col();
    style = C_STYLE;
    return true;
  }

  bool get_bounds_info(Index n, Number* lower, Number* upper, Index m, Number* rows_lower,
                       Number* rows_upper) override {
    std::fill(lower, lower + n, -kInfinite);
    std::fill(upper, upper + n, kInfinite);
    std::fill(rows_upper + n_, rows_upper + m, kInfinite);
    for (int i = 0; i < n_; ++i) rows_lower[i] = rows_upper[i] = load_[i];
    for (int c = 0; c < m_; ++c) {
      const bool smooth = p_.friction[c] == 0;
      lower[n_ + 3 * c] = 0;
      if (smooth) std::fill(lower + n_ + 3 * c + 1, lower + n_ + 3 * c + 3, 0.0);
      if (smooth) std::fill(upper + n_ + 3 * c + 1, upper + n_ + 3 * c + 3, 0.0);
      rows_lower[n_ + c] = smooth ? -kInfinite : 0;
    }
    return true;
  }

  bool get_starting_point(Index, bool, Number* x, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy(start_.begin(), start_.end(), x);
    for (int c = 0; c < m_; ++c) x[n_ + 3 * c] = 1, x[n_ + 3 * c + 1] = x[n_ + 3 * c + 2] = 0;
    return true;
  }

  bool eval_f(Index, const Number* x, bool, Number& value) override {
    const Eigen::Map<const VectorXd> v(x, n_), j(x + n_, 3 * m_);
    value = 0.5 * v.dot(p_.mass * v) + drift_.dot(j);
    return true;
  }
  bool eval_grad_f(Index, const Number* x, bool, Number* gradient) override {
    const Eigen::Map<const VectorXd> v(x, n_);
    Eigen::Map<VectorXd>(gradient, n_) = p_.mass * v;
    Eigen::Map<VectorXd>(gradient + n_, 3 * m_) = drift_;
    return true;
  }
  bool eval_g(Index, const Number* x, bool, Index, Number* rows) override {
    const Eigen::Map<const VectorXd> v(x, n_), j(x + n_, 3 * m_);
    Eigen::Map<VectorXd>(rows, n_) = p_.mass * v - coupling_ * j;
    for (int c = 0; c < m_; ++c) rows[n_ + c] = Cone(c, j.segment<3>(3 * c));
    return true;
  }

  bool eval_jac_g(Index, const Number* x, bool, Index, Index, Index* row, Index* column, Number* values) override {
    Table put{row, column, values};
    for (int col = 0; col < n_; ++col)
      for (SparseMatrix::InnerIterator e(p_.mass, col); e; ++e) put(e.row(), col, e.value());
    for (int col = 0; col < 3 * m_; ++col)
      for (SparseMatrix::InnerIterator e(coupling_, col); e; ++e) put(e.row(), n_ + col, -e.value());
    for (int c = 0; c < m_; ++c)
      for (int i = 0; i < 3; ++i) put(n_ + c, n_ + 3 * c + i, x != nullptr ? Curvature(c, i) * x[n_ + 3 * c + i] : 0);
    return true;
  }

  bool eval_h(Index, const Number*, bool, Number factor, Index, const Number* lambda, bool, Index, Index* row,
              Index* column, Number* values) override {
    Table put{row, column, values};
    for (int col = 0; col < n_; ++col)
      for (SparseMatrix::InnerIterator e(p_.mass, col); e; ++e)
        if (e.row() >= e.col()) put(e.row(), col, factor * e.value());
    for (int c = 0; c < m_; ++c)
      for (int i = 0; i < 3; ++i)
        put(n_ + 3 * c + i, n_ + 3 * c + i, lambda != nullptr ? lambda[n_ + c] * Curvature(c, i) : 0);
    return true;
  }

  void finalize_solution(Ipopt::SolverReturn, Index, const Number* x, const Number*, const Number*, Index,
                         const Number*, const Number*, Number, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    answer_->v = unit_ * Eigen::Map<const VectorXd>(x, n_);
    answer_->j.resize(3 * m_);
    for (int c = 0; c < m_; ++c)
      for (int i = 0; i < 3; ++i) answer_->j[3 * c + i] = unit_ * scale_[c] * x[n_ + 3 * c + i];
  }

 private:
  double Curvature(int c, int i) const { return i == 0 ? 2 * p_.friction[c] * p_.friction[c] : -2; }
  double Cone(int c, const Eigen::Vector3d& j) const {
    return 0.5 * (Curvature(c, 0) * j[0] * j[0] - 2 * j[1] * j[1] - 2 * j[2] * j[2]);
  }

  const GeneralProblem& p_;
  GeneralAnswer* answer_;
  int n_ = 0, m_ = 0;
  double unit_ = 1;
  SparseMatrix coupling_;
  VectorXd scale_, load_, drift_, start_;
};

Ipopt::IpoptApplication& Application() {
  static const Ipopt::SmartPtr<Ipopt::IpoptApplication> application = [] {
    const Ipopt::SmartPtr<Ipopt::IpoptApplication> fresh = IpoptApplicationFactory();
    fresh->Options()->SetIntegerValue("print_level", 0);
    fresh->Options()->SetStringValue("sb", "yes");
    fresh->Options()->SetStringValue("linear_solver", "mumps");
    fresh->Initialize();
    return fresh;
  }();
  return *application;
}

}  // namespace

bool IpoptAvailable() { return true; }
std::string IpoptVersion() { return "ipopt " ISLET_IPOPT_VERSION; }

GeneralAnswer SolveByIpopt(const GeneralProblem& problem, const IpoptLimits& limits) {
  GeneralAnswer answer;
  Ipopt::IpoptApplication& application = Application();
  const double tolerance = std::max(kLeastTolerance, 1e-2 * limits.tolerance * limits.tolerance);
  application.Options()->SetNumericValue("tol", tolerance);
  application.Options()->SetNumericValue("max_cpu_time", limits.seconds);
  application.Options()->SetIntegerValue("max_iter", limits.iterations);
  const Ipopt::SmartPtr<Ipopt::TNLP> program = new ContactProgram(problem, &answer);
  const Ipopt::ApplicationReturnStatus status = application.OptimizeTNLP(program);
  answer.solved = status == Ipopt::Solve_Succeeded;
  if (const auto statistics = application.Statistics(); Ipopt::IsValid(statistics))
    answer.iterations = statistics->IterationCount();
  return answer;
}

}  // namespace islet::studies

#else

namespace islet::studies {

bool IpoptAvailable() { return false; }
std::string IpoptVersion() { return "no ipopt"; }
GeneralAnswer SolveByIpopt(const GeneralProblem&, const IpoptLimits&) { return {}; }

}  // namespace islet::studies

#endif
