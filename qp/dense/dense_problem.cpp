#include "qp/dense/dense_problem.h"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

#include "qp/smallness.h"

namespace islet::qp {
namespace {

constexpr double kIndefiniteTolerance = 1e-3;  // what the factor may miss of W, scaled, before W is refused

[[noreturn]] void Reject(const std::string& what, double value) {
  std::ostringstream text;
  text << "qp::DenseProblem: " << what << " = " << value;
  throw std::invalid_argument(text.str());
}

// Cholesky factor with the largest diagonal entry that is left as the next pivot, until nothing is left.
Eigen::MatrixXd RevealRank(const Eigen::MatrixXd& w) {
  const Eigen::Index size = w.rows();
  Eigen::MatrixXd factor(size, size);
  Eigen::VectorXd left = w.diagonal();
  Eigen::Index rank = 0;
  for (; rank < size; ++rank) {
    Eigen::Index pivot;
    const double largest = left.maxCoeff(&pivot);
    if (!(largest > kExact)) break;
    auto column = factor.col(rank);
    column = w.col(pivot);
    if (rank > 0) column.noalias() -= factor.leftCols(rank) * factor.row(pivot).head(rank).transpose();
    column /= std::sqrt(largest);
    left -= column.cwiseAbs2();
    left[pivot] = 0;
  }
  return factor.leftCols(rank);
}

}  // namespace

void DenseProblem::Validate() const {
  const Eigen::Index size = 3 * static_cast<Eigen::Index>(friction.size());
  if (delassus.rows() != size) Reject("rows of W", static_cast<double>(delassus.rows()));
  if (delassus.cols() != size) Reject("columns of W", static_cast<double>(delassus.cols()));
  if (velocity.size() != size) Reject("size of q", static_cast<double>(velocity.size()));
  if (!delassus.allFinite()) Reject("sum of W", delassus.sum());
  if (!velocity.allFinite()) Reject("sum of q", velocity.sum());
  if (size > 0 && (delassus - delassus.transpose()).cwiseAbs().maxCoeff() > 1e-12 * delassus.cwiseAbs().maxCoeff())
    Reject("largest entry of W - W^T", (delassus - delassus.transpose()).cwiseAbs().maxCoeff());
  for (int c = 0; c < num_contacts(); ++c) {
    const std::string where = "contact " + std::to_string(c) + ": ";
    if (!(friction[c] >= 0) || !std::isfinite(friction[c])) Reject(where + "friction", friction[c]);
    for (int i = 3 * c; i < 3 * c + 3; ++i)
      if (!(delassus(i, i) >= 0)) Reject(where + "diagonal entry of W", delassus(i, i));
    if (!(delassus(3 * c, 3 * c) > 0)) Reject(where + "W_nn", delassus(3 * c, 3 * c));
  }
}

ScaledDenseProblem::ScaledDenseProblem(const DenseProblem& problem, double speed)
    : velocity(problem.velocity), friction(problem.friction), velocity_scale(speed) {
  const int n = problem.num_contacts();
  double sum = 0;
  for (int c = 0; c < n; ++c) {
    scale.push_back(std::sqrt(3 / problem.delassus.diagonal().segment<3>(3 * c).sum()));
    sum += scale[c] * scale[c];
  }
  unit = n > 0 ? speed * std::sqrt(sum / n) : 1;
  Eigen::VectorXd d(3 * n);
  for (int c = 0; c < n; ++c) d.segment<3>(3 * c).setConstant(scale[c]);
  delassus = d.asDiagonal() * problem.delassus * d.asDiagonal();
  velocity = d.cwiseProduct(velocity) / unit;
  factor = RevealRank(delassus);
  const double missed = n > 0 ? (delassus - factor * factor.transpose()).cwiseAbs().maxCoeff() : 0;
  if (!(missed < kIndefiniteTolerance)) Reject("W is not positive semidefinite; scaled, it is off by", missed);
}

}  // namespace islet::qp
