#include "qp/dense/dense_gram.h"

#include "qp/smallness.h"

namespace islet::qp {
namespace {

constexpr double kSparseShare = 0.15;  // of the dense work: the scattered sums of the sparse way are that much slower

}  // namespace

void DenseGram::Prepare(const ScaledDenseProblem& problem) {
  a_ = &problem.factor;
  first_.assign(1, 0);
  columns_.clear();
  entries_.clear();
  double work = 0;
  for (int c = 0; c < problem.num_contacts(); ++c) {
    for (int k = 0; k < a_->cols(); ++k) {
      const Vector3 entry = a_->block<3, 1>(3 * c, k);
      if (entry.cwiseAbs().maxCoeff() <= kRounding) continue;
      columns_.push_back(k);
      entries_.push_back(entry);
    }
    const double count = static_cast<double>(columns_.size()) - first_.back();
    work += count * count;
    first_.push_back(static_cast<int>(columns_.size()));
  }
  const auto rank = static_cast<double>(a_->cols());
  sparse_ = work <= kSparseShare * rank * rank * problem.num_contacts();
}

void DenseGram::Add(const std::vector<Matrix3>& weights, Eigen::MatrixXd* system) {
  if (sparse_) {
    AddSparse(weights, system);
  } else {
    AddDense(weights, system);
  }
}

void DenseGram::AddSparse(const std::vector<Matrix3>& weights, Eigen::MatrixXd* system) {
  for (size_t c = 0; c < weights.size(); ++c) {
    if (weights[c].isZero(0)) continue;
    for (int j = first_[c]; j < first_[c + 1]; ++j) {
      const Vector3 weighted = weights[c] * entries_[j];
      double* const column = &(*system)(0, columns_[j]);
      for (int i = first_[c]; i < first_[c + 1]; ++i) column[columns_[i]] += entries_[i].dot(weighted);
    }
  }
}

void DenseGram::AddDense(const std::vector<Matrix3>& weights, Eigen::MatrixXd* system) {
  pressing_.resize(a_->rows(), a_->cols());
  weighted_.resize(a_->rows(), a_->cols());
  int rows = 0;
  for (size_t c = 0; c < weights.size(); ++c) {
    if (weights[c].isZero(0)) continue;
    pressing_.middleRows<3>(rows) = a_->middleRows<3>(3 * c);
    weighted_.middleRows<3>(rows).noalias() = weights[c] * a_->middleRows<3>(3 * c);
    rows += 3;
  }
  system->noalias() += pressing_.topRows(rows).transpose() * weighted_.topRows(rows);
}

}  // namespace islet::qp
