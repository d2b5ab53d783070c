#include "qp/linear_algebra/kkt.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <type_traits>

namespace islet::qp {
namespace {

static_assert(sizeof(Matrix3) == 9 * sizeof(double));

// The 6x6 part of a place that belongs to field f of its rows and field g of its columns.
template <typename Number>
Number* FieldAt(const BlockPlaceOf<Number>& place, int row_field, int column_field) {
  return place.data + 6 * row_field + 6 * column_field * static_cast<ptrdiff_t>(place.stride);
}

template <typename Number>
void AddMass(double mass, const Matrix3& inertia, double sign, Number* at, int stride) {
  for (int i = 0; i < 3; ++i) {
    at[i + i * stride] += static_cast<Number>(sign * mass);
    for (int j = 0; j < 3; ++j) at[3 + i + (3 + j) * stride] += static_cast<Number>(sign * inertia(i, j));
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
  const int supernodes = full_.cholesky.elimination().num_supernodes();
  SortByKey(
      sorted_too_, supernodes, [&](int item) { return full_.cholesky.SupernodeOf(nodes(item)[0], nodes(item)[1]); },
      &count_, &sorted_);
  block_start_.assign(1, 0);
  for (int s = 0; s < supernodes; ++s) block_start_.push_back(count_[s]);  // counts have moved on by one
  block_of_body_.resize(nb);
  block_of_pair_.resize(pairs_.size());
  blocks_.clear();
  for (int item : sorted_) {
    (item < nb ? block_of_body_[item] : block_of_pair_[item - nb]) = static_cast<int>(blocks_.size());
    blocks_.push_back({item < nb ? item : -1, false, 0, 0, 0});
  }
  PlaceIn(&full_);
  for (size_t b = 0; b < blocks_.size(); ++b) blocks_[b].transposed = full_.places[b].transposed;
}

template <typename Number>
void KktSystem::PlaceIn(Matrix<Number>* matrix) {
  matrix->places.resize(blocks_.size());
  for (size_t i = 0; i < block_of_body_.size(); ++i) {
    const int node = static_cast<int>(i);
    matrix->places[block_of_body_[i]] = matrix->cholesky.BlockAt(node, node);
  }
  for (size_t p = 0; p < pairs_.size(); ++p)
    matrix->places[block_of_pair_[p]] = matrix->cholesky.BlockAt(pairs_[p][0], pairs_[p][1]);
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
      const bool transposed = blocks_[block].transposed;
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
  full_.rows.resize(2 * 3 * kVector * problem.contacts.size());
  sorted_.assign(2 * problem.contacts.size(), -1);  // place of side a (2c), b (2c + 1) in rows_
  int sides = 0;
  const auto place = [&](int side) {
    if (sorted_[side] >= 0) return sorted_[side];
    const ContactTerm& contact = problem.contacts[side / 2];
    const Jacobian& jacobian = side % 2 == 0 ? contact.jacobian_a : contact.jacobian_b;
    double* to = full_.rows.data() + static_cast<size_t>(sides) * 3 * kVector;
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
  if (full_.cholesky.Analyse(problem.num_bodies(), 6 * num_fields, pairs_)) {
    PlaceBlocks(problem.num_bodies());
    single_placed_ = false;
  }
  single_packed_ = false;
  ListProducts(problem);
  Pack(problem);
}

// What the full one has, with its numbers rounded.
void KktSystem::PrepareSingle() {
  if (!single_placed_) {
    single_.cholesky.Follow(full_.cholesky);
    PlaceIn(&single_);
  }
  if (!single_packed_) {
    constexpr size_t kWide = FrontOf<float>::kVector;
    const size_t rows = full_.rows.size() / kVector;
    single_.rows.assign(rows * kWide, 0.0f);
    for (size_t r = 0; r < rows; ++r)
      for (size_t i = 0; i < 6; ++i) single_.rows[r * kWide + i] = static_cast<float>(full_.rows[r * kVector + i]);
  }
  single_placed_ = single_packed_ = true;
}

template <typename Number>
void KktSystem::AddBlock(Matrix<Number>& matrix, int b, const Number* d) {
  const Block& block = blocks_[b];
  const BlockPlaceOf<Number>& place = matrix.places[b];
  const int cone_field = num_fields_ - 1, stride = place.stride;
  if (block.body >= 0) {
    const auto& [mass, inertia] = masses_[block.mass];
    AddMass(mass, inertia, 1, FieldAt(place, 0, 0), stride);
    if (num_fields_ == 2) AddMass(mass, inertia, -1, FieldAt(place, 1, 0), stride);
  }
  const int count = block.products_end - block.products_begin;
  const ContactProduct* products = products_.data() + block.products_begin;
  matrix.kernels->add_products(count, products, matrix.rows.data(), d, num_fields_ == 1 ? 1 : -1,
                               FieldAt(place, cone_field, cone_field), stride);
  if constexpr (std::is_same_v<Number, double>) {
    if (num_fields_ == 1) return;
    matrix.kernels->add_products(count, products, matrix.rows.data(), normal_blocks_[0].data(), 1, FieldAt(place, 0, 0),
                                 stride);
  }
}

int KktSystem::Factorise(const Problem& problem, const std::vector<Matrix3>& d, const std::vector<double>& e,
                         Precision precision) {
  by_single_ = precision == Precision::kSingle && CanBeSingle();
  assert(pair_of_.size() == problem.contacts.size());
  static_cast<void>(problem);
  if (num_fields_ == 2) {
    normal_blocks_.assign(std::max<size_t>(1, e.size()), Matrix3::Zero());
    for (size_t c = 0; c < e.size(); ++c) normal_blocks_[c](0, 0) = e[c];
  }
  const double* blocks = d.empty() ? nullptr : d[0].data();
  static constexpr double kSigns[12] = {1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1};
  const std::span<const double> signs(kSigns, static_cast<size_t>(6 * num_fields_));
  const auto factorise = [&](auto& matrix, const auto* values) {
    return matrix.cholesky.Factorise(signs, [&](int s) {
      for (int b = block_start_[s]; b < block_start_[s + 1]; ++b) AddBlock(matrix, b, values);
    });
  };
  if (!by_single_) return factorise(full_, blocks);
  PrepareSingle();
  single_d_.resize(9 * d.size());
  for (size_t i = 0; i < single_d_.size(); ++i) single_d_[i] = static_cast<float>(blocks[i]);
  return factorise(single_, single_d_.data());
}

void KktSystem::Solve(double* x) {
  if (by_single_) {
    single_.cholesky.Solve(x);
  } else {
    full_.cholesky.Solve(x);
  }
}

}  // namespace islet::qp
