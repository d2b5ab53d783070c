#include "qp/interior_point/row_batches.h"

#include <algorithm>
#include <numeric>

namespace islet::qp {

void RowBatches::Clear() {
  batches_.clear();
  open_.fill(-1);
  num_rows_ = 0;
}

RowPlace RowBatches::Add(const Item& item) {
  int& open = open_[kKinds * item.field + static_cast<int>(item.cone.kind)];
  if (open < 0 || batches_[open].used[kRowLanes - 1] > 0) {
    open = static_cast<int>(batches_.size());
    RowBatch& fresh = batches_.emplace_back();
    fresh.rows = NumRows(item.cone.kind);
    fresh.first = static_cast<int>(num_rows_);
    fresh.sign = item.field == 0 ? 1 : -1;
    std::fill_n(fresh.offset[0], kRowLanes, 1.0);
    num_rows_ += fresh.rows;
  }
  RowBatch& batch = batches_[open];
  const int lane = static_cast<int>(std::find(batch.used, batch.used + kRowLanes, 0.0) - batch.used);
  batch.used[lane] = 1;
  batch.contact[lane] = item.index;
  batch.friction[lane] = item.cone.friction;
  batch.compliance[lane] = item.compliance;
  batch.soft = batch.soft || item.compliance > 0;
  for (int d = 0; d < 3; ++d) {
    batch.offset[d][lane] = item.offset[d];
    for (int k = 0; k < 6; ++k) {
      batch.jacobian[0][d][k][lane] = item.contact.jacobian_a(d, k);
      batch.jacobian[1][d][k][lane] = item.contact.jacobian_b(d, k);
    }
  }
  return {lane, batch.first};
}

void RowBatches::Finish(const Problem& problem, int num_fields) {
  num_fields_ = num_fields;
  start_.assign(static_cast<size_t>(num_fields) * problem.num_bodies() + 1, 0);
  // visit(batch, lane, side, place): place is that of the body's field among all.
  const auto each = [&](const auto& visit) {
    for (size_t b = 0; b < batches_.size(); ++b) {
      const int field = batches_[b].sign > 0 ? 0 : 1;
      for (int l = 0; l < kRowLanes && batches_[b].used[l] > 0; ++l) {
        const ContactTerm& contact = problem.contacts[batches_[b].contact[l]];
        if (contact.body_a >= 0) visit(b, l, 0, num_fields * contact.body_a + field);
        if (contact.body_b >= 0) visit(b, l, 1, num_fields * contact.body_b + field);
      }
    }
  };
  each([&](size_t, int, int, int place) { ++start_[place + 1]; });
  std::partial_sum(start_.begin(), start_.end(), start_.begin());
  sides_.resize(start_.back());
  force_at_.resize(start_.back());
  each([&](size_t b, int lane, int side, int place) {
    RowBatch& batch = batches_[b];
    batch.velocity[side][lane] = 6 * place;
    const int at = start_[place]++;
    force_at_[at] = static_cast<int>(3 * b) * kRowLanes + lane;
    for (int d = 0; d < 3; ++d) {
      double* row = sides_[at].rows[d];
      for (int k = 0; k < 6; ++k) row[k] = batch.jacobian[side][d][k][lane];
      row[6] = row[7] = 0;
    }
  });
  std::rotate(start_.begin(), start_.end() - 1, start_.end());  // each has moved on to where the next begins
  start_[0] = 0;
}

// Empty lanes stay at the unit element.
void RowBatches::FillWithUnits(std::vector<Lanes>* rows) const {
  rows->assign(num_rows_, Lanes{});
  for (const RowBatch& batch : batches_)
    for (int i = 0; i < batch.rows; ++i)
      if (i == 0 || batch.rows == NumRows(ConeKind::kOctagon)) std::fill_n((*rows)[batch.first + i].at, kRowLanes, 1.0);
}

Vector3 ImpulseAt(const ContactCone& cone, const std::vector<Lanes>& z, const RowPlace& place) {
  double rows[kMaxRows];
  for (int i = 0; i < NumRows(cone.kind); ++i) rows[i] = z[place.first + i].at[place.lane];
  return MapFromRows(cone, rows);
}

}  // namespace islet::qp
