#include "bench/studies/general_problem.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

namespace islet::studies {
namespace {

constexpr double kRankTolerance = 1e-13;  // of the largest eigenvalue: smaller ones are zero
constexpr double kNegative = 1e-6;        // of the largest eigenvalue: more negative ones are not rounding

// A^T with W = A A^T, as many rows as W has rank.
SparseMatrix TransposedFactor(const SparseMatrix& delassus) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> spectrum{Eigen::MatrixXd(delassus)};
  const Eigen::VectorXd& values = spectrum.eigenvalues();
  const double largest = values.cwiseAbs().maxCoeff();
  if (values.minCoeff() < -kNegative * largest) throw FclibError("W is not positive semidefinite");
  const auto rank = std::max<Eigen::Index>(1, (values.array() > kRankTolerance * largest).count());
  const Eigen::MatrixXd factor =
      spectrum.eigenvectors().rightCols(rank) * values.tail(rank).cwiseMax(0).cwiseSqrt().asDiagonal();
  return factor.transpose().sparseView();
}

}  // namespace

GeneralProblem MakeGeneral(const FclibProblem& file) {
  GeneralProblem problem;
  problem.friction = file.friction;
  if (file.global) {
    problem.mass = file.mass, problem.coupling = file.coupling;
    problem.load = file.load, problem.drift = file.drift;
  } else {
    problem.coupling = TransposedFactor(file.delassus);
    problem.mass.resize(problem.coupling.rows(), problem.coupling.rows());
    problem.mass.setIdentity();
    problem.load.setZero(problem.coupling.rows());
    problem.drift = file.q;
  }
  problem.mass.makeCompressed();
  problem.coupling.makeCompressed();
  return problem;
}

void RestoreMomentum(const GeneralProblem& problem, GeneralAnswer* answer) {
  const Eigen::SimplicialLLT<SparseMatrix> factors(problem.mass);
  answer->v = factors.solve(problem.load + problem.coupling * answer->j);
}

}  // namespace islet::studies
