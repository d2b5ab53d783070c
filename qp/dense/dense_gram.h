// The matrix that dense_newton factorises: A^T G A, summed over the contacts, each with a 3 x 3 weight of its own.
//
// The factor of a pile's W has mostly zeros: where they save enough, contacts are added entry by entry, else by one dense
// product.
//   threads: one caller at a time; allocates only while problems grow
#pragma once

#include "qp/dense/dense_problem.h"

namespace islet::qp {

class DenseGram {
 public:
  void Prepare(const ScaledDenseProblem& problem);  // which must outlive the calls of Add

  // system += A^T G A. Contacts of weight zero cost nothing.
  void Add(const std::vector<Matrix3>& weights, Eigen::MatrixXd* system);

 private:
  void AddSparse(const std::vector<Matrix3>& weights, Eigen::MatrixXd* system);
  void AddDense(const std::vector<Matrix3>& weights, Eigen::MatrixXd* system);

  const Eigen::MatrixXd* a_ = nullptr;
  bool sparse_ = false;
  std::vector<int> first_, columns_;     // per contact, from first_[c] on: columns in which A_c is not zero
  std::vector<Vector3> entries_;         // and those columns of A_c
  Eigen::MatrixXd pressing_, weighted_;  // dense way: rows of the contacts with weight; the same times G
};

}  // namespace islet::qp
