#include "qp/linear_algebra/kkt.h"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace islet::qp {
namespace {

static_assert(sizeof(Matrix3) == 9 * sizeof(double));

// The 6x6 part of a place that belongs to field f of its rows and field g of its columns.
double* FieldAt(const BlockPlace& place, int row_field, int column_field) {
  return place.data + 6 * row_field + 6 * column_field * static_cast<ptrdiff_t>(place.stride);
}

void AddMass(double mass, const Matrix3& inertia, double sign, double* at, int stride) {
  for (int i = 0; i < 3; ++i) {
    at[i + i * stride] += sign * mass;
    for (int j = 0; j < 3; ++j) at[3 + i + (3 + j) * stride] += sign * inertia(i, j);
  }
}

// Sorts `items` by a key in [0, keys), stably, by counting.
template <typename Key>
void SortByKey(const std::vector<int>& items, int keys, const Key& key, std::vector<int>* count,
               std::vector<int>* out) {
  count->assign(keys + 1, 0);
  for (int item : items) ++(*count)[key(item) + 1];
  std::partial_sum(count->begin(), count->end(), count->begin());
  out->resize(items.size());
  for (int item : items) (*out)[(*count)[key(item)]++] = item;
}

}  // namespace

void KktSystem::FindPairs(const Problem& problem) {
  const int nb = problem.num_bodies(), nc = problem.num_contacts();
  const auto low = [&](int c) { return std::min(problem.contacts[c].body_a, problem.contacts[c].body_b); };
  const auto high = [&](int c) { return std::max(problem.contacts[c].body_a, problem.contacts[c].body_b); };
  sorted_.clear();
  for (int c = 0; c < nc; ++c)
    if (low(c) >= 0) sorted_.push_back(c);
  SortByKey(sorted_, nb, high, &count_, &sorted_too_);
  SortByKey(sorted_too_, nb, low, &count_, &sorted_);
  pairs_.clear();
  pair_of_.assign(nc, -1);
  for (int c : sorted_) {
    const std::array<int, 2> pair{low(c), high(c)};
    if (pairs_.empty() || pairs_.back() != pair) pairs_.push_back(pair);
    pair_of_[c] = static_cast<int>(pairs_.size()) - 1;
  }
}

// Blocks in the order of their supernodes; item i < nb is a body, nb + p a pair.
void KktSystem::PlaceBlocks(int nb) {
  const int items = nb + static_cast<int>(pairs_.size());
  const auto nodes = [&](int item) { return item < nb ? std::array{item, item} : pairs_[item - nb]; };
  sorted_too_.resize(items);
  std::iota(sorted_too_.begin(), sorted_too_.end(), 0);
  const int supernodes = cholesky_.elimination().num_supernodes();
  SortByKey(
      sorted_too_, supernodes, [&](int item) { return cholesky_.SupernodeOf(nodes(item)[0], nodes(item)[1]); }, &count_,
      &sorted_);
  block_start_.assign(1, 0);
  for (int s = 0; s < supernodes; ++s) block_start_.push_back(count_[s]);  // counts have moved on by one
  block_of_body_.resize(nb);
  block_of_pair_.resize(pairs_.size());
  blocks_.clear();
  for (int item : sorted_) {
    (item < nb ? block_of_body_[item] : block_of_pair_[item - nb]) = static_cast<int>(blocks_.size());
    blocks_.push_back({cholesky_.BlockAt(nodes(item)[0], nodes(item)[1]), item < nb ? item : -1, 0, 0, 0});
  }
}

void KktSystem::ListProducts(const Problem& problem) {
  const int nc = problem.num_contacts();
  for (Block& block : blocks_) block.products_begin = block.products_end = 0;
  const auto each = [&](const auto& add) {
    for (int c = 0; c < nc; ++c) {
      const ContactTerm& contact = problem.contacts[c];
      if (contact.body_a >= 0) add(block_of_body_[contact.body_a], ContactProduct{2 * c, 2 * c, c});
      if (contact.body_b >= 0) add(block_of_body_[contact.body_b], ContactProduct{2 * c + 1, 2 * c + 1, c});
      if (pair_of_[c] < 0) continue;
      const int block = block_of_pair_[pair_of_[c]];
      const bool a_first = pairs_[pair_of_[c]][0] == contact.body_a;
      const int first = a_first ? 2 * c : 2 * c + 1, second = 4 * c + 1 - first;
      // Asked for as (low, high): transposed if the rows belong to the higher one.
      const bool transposed = blocks_[block].place.transposed;
      add(block, transposed ? ContactProduct{second, first, c} : ContactProduct{first, second, c});
    }
  };
  each([&](int block, const ContactProduct&) { ++blocks_[block].products_end; });
  int total = 0;
  for (Block& block : blocks_) {
    block.products_begin = total;
    total += block.products_end;
    block.products_end = block.products_begin;
  }
  products_.resize(total);
  each([&](int block, const ContactProduct& product) { products_[blocks_[block].products_end++] = product; });
}

// Masses and Jacobians side by side as a factorisation walks through them.
void KktSystem::Pack(const Problem& problem) {
  masses_.clear();
  for (Block& block : blocks_) {
    if (block.body < 0) continue;
    block.mass = static_cast<int>(masses_.size());
    masses_.push_back({problem.bodies[block.body].mass, problem.bodies[block.body].inertia});
  }
  rows_.resize(2 * 3 * kVector * problem.contacts.size());
  sorted_.assign(2 * problem.contacts.size(), -1);  // place of side a (2c), b (2c + 1) in rows_
  int sides = 0;
  const auto place = [&](int side) {
    if (sorted_[side] >= 0) return sorted_[side];
    const ContactTerm& contact = problem.contacts[side / 2];
    const Jacobian& jacobian = side % 2 == 0 ? contact.jacobian_a : contact.jacobian_b;
    double* to = rows_.data() + static_cast<size_t>(sides) * 3 * kVector;
    for (int r = 0; r < 3; ++r, to += kVector) {
      for (int i = 0; i < 6; ++i) to[i] = jacobian(r, i);
      to[6] = to[7] = 0;
    }
    return sorted_[side] = sides++;
  };
  for (ContactProduct& product : products_) {
    product.left = place(product.left);
    product.right = place(product.right);
  }
}

void KktSystem::Prepare(const Problem& problem, int num_fields) {
  num_fields_ = num_fields;
  FindPairs(problem);
  if (cholesky_.Analyse(problem.num_bodies(), 6 * num_fields, pairs_)) PlaceBlocks(problem.num_bodies());
  ListProducts(problem);
  Pack(problem);
}

void KktSystem::AddBlock(const Block& block, const double* d) {
  const int cone_field = num_fields_ - 1, stride = block.place.stride;
  if (block.body >= 0) {
    const auto& [mass, inertia] = masses_[block.mass];
    AddMass(mass, inertia, 1, FieldAt(block.place, 0, 0), stride);
    if (num_fields_ == 2) AddMass(mass, inertia, -1, FieldAt(block.place, 1, 0), stride);
  }
  const int count = block.products_end - block.products_begin;
  const ContactProduct* products = products_.data() + block.products_begin;
  kernels_->add_products(count, products, rows_.data(), d, num_fields_ == 1 ? 1 : -1,
                         FieldAt(block.place, cone_field, cone_field), stride);
  if (num_fields_ == 1) return;
  kernels_->add_products(count, products, rows_.data(), normal_blocks_[0].data(), 1, FieldAt(block.place, 0, 0),
                         stride);
}

int KktSystem::Factorise(const std::vector<Matrix3>& d, const std::vector<double>& e) {
  assert(pair_of_.size() == d.size());
  if (num_fields_ == 2) {
    normal_blocks_.assign(std::max<size_t>(1, e.size()), Matrix3::Zero());
    for (size_t c = 0; c < e.size(); ++c) normal_blocks_[c](0, 0) = e[c];
  }
  const double* blocks = d.empty() ? nullptr : d[0].data();
  static constexpr double kSigns[12] = {1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1};
  return cholesky_.Factorise({kSigns, static_cast<size_t>(6 * num_fields_)}, [&](int s) {
    for (int b = block_start_[s]; b < block_start_[s + 1]; ++b) AddBlock(blocks_[b], blocks);
  });
}

void KktSystem::Solve(double* x) { cholesky_.Solve(x); }

}  // namespace islet::qp
