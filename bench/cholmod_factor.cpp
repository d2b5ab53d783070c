#include "bench/cholmod_factor.h"

#include <algorithm>
#include <vector>

#ifdef ISLET_HAVE_CHOLMOD

#include <cholmod.h>
#include <dlfcn.h>
#include <Eigen/SparseCore>
extern "C" void openblas_set_num_threads(int);

namespace islet::qp {
namespace {

using Sparse = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

// M + sum J^T J, lower triangle: time depends on the pattern, not on the scalings.
Sparse NewtonMatrix(const Problem& problem) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](int row, int column, const Eigen::Matrix<double, 6, 6>& block) {
    for (int j = 0; j < 6; ++j)
      for (int i = row == column ? j : 0; i < 6; ++i) entries.emplace_back(6 * row + i, 6 * column + j, block(i, j));
  };
  for (int i = 0; i < problem.num_bodies(); ++i) {
    Eigen::Matrix<double, 6, 6> mass = Eigen::Matrix<double, 6, 6>::Zero();
    mass.diagonal().head<3>().setConstant(problem.bodies[i].mass);
    mass.bottomRightCorner<3, 3>() = problem.bodies[i].inertia;
    add(i, i, mass);
  }
  for (const ContactTerm& c : problem.contacts) {
    if (c.body_a >= 0) add(c.body_a, c.body_a, c.jacobian_a.transpose() * c.jacobian_a);
    if (c.body_b >= 0) add(c.body_b, c.body_b, c.jacobian_b.transpose() * c.jacobian_b);
    if (c.body_a < 0 || c.body_b < 0) continue;
    const bool below = c.body_a > c.body_b;
    const Jacobian &row = below ? c.jacobian_a : c.jacobian_b, &column = below ? c.jacobian_b : c.jacobian_a;
    add(std::max(c.body_a, c.body_b), std::min(c.body_a, c.body_b), row.transpose() * column);
  }
  Sparse lower(6 * problem.num_bodies(), 6 * problem.num_bodies());
  lower.setFromTriplets(entries.begin(), entries.end());
  return lower;
}

}  // namespace

struct CholmodFactor::Impl {
  Sparse lower;
  cholmod_common common;
  cholmod_sparse view{};
  cholmod_factor* factor = nullptr;
};

bool CholmodFactor::Available() { return true; }

CholmodFactor::CholmodFactor(const Problem& problem) : impl_(std::make_unique<Impl>()) {
  // CHOLMOD 3 opens OpenMP regions of four threads, whatever OMP_NUM_THREADS says; zero active levels keep them in this one.
  using Setter = void (*)(int);
  if (const auto set = reinterpret_cast<Setter>(dlsym(RTLD_DEFAULT, "omp_set_max_active_levels"))) set(0);
  openblas_set_num_threads(1);
  impl_->lower = NewtonMatrix(problem);
  cholmod_start(&impl_->common);
  impl_->common.supernodal = CHOLMOD_SUPERNODAL;
  cholmod_sparse& view = impl_->view;
  view.nrow = view.ncol = static_cast<size_t>(impl_->lower.rows());
  view.nzmax = static_cast<size_t>(impl_->lower.nonZeros());
  view.p = impl_->lower.outerIndexPtr(), view.i = impl_->lower.innerIndexPtr(), view.x = impl_->lower.valuePtr();
  view.stype = -1, view.itype = CHOLMOD_INT, view.xtype = CHOLMOD_REAL, view.dtype = CHOLMOD_DOUBLE;
  view.sorted = view.packed = 1;
  impl_->factor = cholmod_analyze(&view, &impl_->common);
  Turn();
}

CholmodFactor::~CholmodFactor() {
  cholmod_free_factor(&impl_->factor, &impl_->common);
  cholmod_finish(&impl_->common);
}

bool CholmodFactor::Turn() {
  return cholmod_factorize(&impl_->view, impl_->factor, &impl_->common) != 0 && impl_->common.status == CHOLMOD_OK;
}

}  // namespace islet::qp

#else

namespace islet::qp {

struct CholmodFactor::Impl {};
bool CholmodFactor::Available() { return false; }
CholmodFactor::CholmodFactor(const Problem&) {}
CholmodFactor::~CholmodFactor() = default;
bool CholmodFactor::Turn() { return false; }

}  // namespace islet::qp

#endif
