// The contacts of an interior-point solve in batches of eight (row_kernels.h), and the way back: the sides that press on each
// body, so that bodies gather forces side by side, each in the order of its contacts.
//   threads: built by one; Gather by any number on disjoint bodies; allocates only while problems grow
#pragma once

#include <array>
#include <vector>

#include "qp/cone.h"
#include "qp/interior_point/row_kernels.h"
#include "qp/problem.h"

namespace islet::qp {

// Of one contact's rows: row i is [first + i].at[lane] of an array of rows.
struct RowPlace {
  int lane = 0, first = 0;
};

class RowBatches {
 public:
  struct Item {
    const ContactTerm& contact;
    int index;  // of the contact
    ContactCone cone;
    Vector3 offset;
    double compliance;
    int field;  // rows of field 1 enter the matrix negatively
  };

  void Clear();
  RowPlace Add(const Item& item);
  // Closes what Add has begun. num_fields: of six unknowns for each body.
  void Finish(const Problem& problem, int num_fields);

  size_t size() const { return batches_.size(); }
  size_t num_rows() const { return num_rows_; }  // Lanes in an array of rows
  const RowBatch* batches() const { return batches_.data(); }
  void FillWithUnits(std::vector<Lanes>* rows) const;

  // out[6 (num_fields body + field) ..] = sum of J^T f for bodies first .. last-1; forces: three Lanes a batch.
  void Gather(const RowKernels& kernels, int first, int last, const Lanes* forces, double* out) const {
    kernels.gather(num_fields_ * first, num_fields_ * last, start_.data(), sides_.data(), force_at_.data(), forces,
                   out);
  }

 private:
  static constexpr int kKinds = 3;
  std::vector<RowBatch> batches_;
  std::array<int, 2 * kKinds> open_{};  // per field and kind: the batch with empty lanes, or -1
  size_t num_rows_ = 0;
  int num_fields_ = 1;
  std::vector<int> start_;  // per body and field: into sides_
  std::vector<SideRows> sides_;
  std::vector<int> force_at_;  // per side
};

// T^T z of one contact.
Vector3 ImpulseAt(const ContactCone& cone, const std::vector<Lanes>& z, const RowPlace& place);

}  // namespace islet::qp
