#include "qp/kkt.h"

#include <algorithm>

namespace islet::qp {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Block = Eigen::Map<Matrix6, 0, Eigen::OuterStride<>>;

// The 6x6 part of a place that belongs to field f of its rows and field f of its columns.
Block FieldBlock(const BlockPlace& place, int row_field, int column_field) {
  return Block(place.data + 6 * row_field + 6 * column_field * static_cast<ptrdiff_t>(place.stride),
               Eigen::OuterStride<>(place.stride));
}

void AddMass(const BodyTerm& body, double sign, Block block) {
  for (int i = 0; i < 3; ++i) block(i, i) += sign * body.mass;
  block.bottomRightCorner<3, 3>() += sign * body.inertia;
}

// block += sign rows^T inner columns for a rank-3 or rank-1 term.
template <typename Rows, typename Inner, typename Columns>
void AddProduct(double sign, const Rows& rows, const Inner& inner, const Columns& columns, Block block) {
  const auto scaled = (sign * (inner * columns)).eval();
  block.noalias() += rows.transpose().lazyProduct(scaled);
}

}  // namespace

void KktSystem::Prepare(const Problem& problem, int num_fields) {
  pairs_.clear();
  for (const ContactTerm& c : problem.contacts) {
    if (c.body_a >= 0 && c.body_b >= 0) pairs_.push_back({std::min(c.body_a, c.body_b), std::max(c.body_a, c.body_b)});
  }
  std::sort(pairs_.begin(), pairs_.end());
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
  num_fields_ = num_fields;
  cholesky_.Analyse(problem.num_bodies(), 6 * num_fields, pairs_);
  diagonal_.resize(problem.num_bodies());
  for (int i = 0; i < problem.num_bodies(); ++i) diagonal_[i] = cholesky_.BlockAt(i, i);
  off_diagonal_.resize(problem.num_contacts());
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const bool both = contact.body_a >= 0 && contact.body_b >= 0;
    off_diagonal_[c] = both ? cholesky_.BlockAt(contact.body_a, contact.body_b) : BlockPlace{nullptr, 0, false};
  }
}

int KktSystem::Factorise(const Problem& problem, const std::vector<Matrix3>& d, const std::vector<double>& e) {
  cholesky_.SetZero();
  const int cone_field = num_fields_ - 1;
  const double cone_sign = num_fields_ == 1 ? 1 : -1;
  for (int i = 0; i < problem.num_bodies(); ++i) {
    AddMass(problem.bodies[i], 1, FieldBlock(diagonal_[i], 0, 0));
    if (num_fields_ == 2) AddMass(problem.bodies[i], -1, FieldBlock(diagonal_[i], 1, 0));
  }
  const auto add_contact = [&](int c, int field, double sign, const auto& inner, const auto& a, const auto& b) {
    const ContactTerm& contact = problem.contacts[c];
    if (contact.body_a >= 0) AddProduct(sign, a, inner, a, FieldBlock(diagonal_[contact.body_a], field, field));
    if (contact.body_b >= 0) AddProduct(sign, b, inner, b, FieldBlock(diagonal_[contact.body_b], field, field));
    if (off_diagonal_[c].data == nullptr) return;
    const Block block = FieldBlock(off_diagonal_[c], field, field);
    if (off_diagonal_[c].transposed) {
      AddProduct(sign, b, inner, a, block);
    } else {
      AddProduct(sign, a, inner, b, block);
    }
  };
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    add_contact(c, cone_field, cone_sign, d[c], contact.jacobian_a, contact.jacobian_b);
    if (num_fields_ == 1) continue;
    const Eigen::Matrix<double, 1, 1> inner(e[c]);
    add_contact(c, 0, 1, inner, contact.jacobian_a.topRows<1>(), contact.jacobian_b.topRows<1>());
  }
  static constexpr double kSigns[12] = {1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1};
  return cholesky_.Factorise({kSigns, static_cast<size_t>(6 * num_fields_)});
}

}  // namespace islet::qp
