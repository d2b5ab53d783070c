// What is added to the blocks of a body matrix, supernode by supernode: the products of contacts and the masses.
//
//   in     a problem, the factorisation of its graph, and what names the rows of a contact at its bodies
//   out    per supernode the parts that assembling it adds, with where in its front they go
//   threads: List by one; reading from any number; allocates only while problems grow
#pragma once

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "qp/linear_algebra/block_cholesky.h"
#include "qp/problem.h"

namespace islet::qp {

// Pairs of bodies in contact, the lower number first, ascending, each once.
inline void FindBodyPairs(const Problem& problem, std::vector<std::array<int, 2>>* pairs) {
  pairs->clear();
  for (const ContactTerm& contact : problem.contacts) {
    if (contact.body_a < 0 || contact.body_b < 0) continue;
    pairs->push_back({std::min(contact.body_a, contact.body_b), std::max(contact.body_a, contact.body_b)});
  }
  std::sort(pairs->begin(), pairs->end());
  pairs->erase(std::unique(pairs->begin(), pairs->end()), pairs->end());
}

// Rows names the rows of one side of a contact.
template <typename Rows>
class SupernodeParts {
 public:
  // One contact's share of one block, left^T D right.
  struct Product {
    int contact;
    Rows left, right;
    double* to;
    int stride;
  };
  struct Mass {
    int body;
    double* to;
    int stride;
  };

  // rows(contact, side): side 0 is body a's, 1 body b's. cholesky: of the problem's bodies and pairs.
  template <typename RowsOf>
  void List(const Problem& problem, BlockCholesky& cholesky, RowsOf rows) {
    const int supernodes = cholesky.elimination().num_supernodes(), nb = problem.num_bodies();
    product_start_.assign(supernodes + 1, 0);
    mass_start_.assign(supernodes + 1, 0);
    // A pair's block is asked for with the body first whose rows it holds.
    const auto each_product = [&](const auto& add) {
      for (int c = 0; c < problem.num_contacts(); ++c) {
        const int a = problem.contacts[c].body_a, b = problem.contacts[c].body_b;
        if (a >= 0) add(a, a, Product{c, rows(c, 0), rows(c, 0), nullptr, 0});
        if (b >= 0) add(b, b, Product{c, rows(c, 1), rows(c, 1), nullptr, 0});
        if (a >= 0 && b >= 0) add(a, b, Product{c, rows(c, 0), rows(c, 1), nullptr, 0});
      }
    };
    each_product([&](int i, int j, const Product&) { ++product_start_[cholesky.SupernodeOf(i, j)]; });
    for (int i = 0; i < nb; ++i) ++mass_start_[cholesky.SupernodeOf(i, i)];
    for (auto* start : {&product_start_, &mass_start_})
      std::exclusive_scan(start->begin(), start->end(), start->begin(), 0);
    products_.resize(product_start_.back());
    masses_.resize(mass_start_.back());
    each_product([&](int i, int j, Product product) {
      const BlockPlace place = cholesky.BlockAt(i, j);
      product.to = place.data;
      product.stride = place.stride;
      if (place.transposed) std::swap(product.left, product.right);
      products_[product_start_[cholesky.SupernodeOf(i, j)]++] = product;
    });
    for (int i = 0; i < nb; ++i) {
      const BlockPlace place = cholesky.BlockAt(i, i);
      masses_[mass_start_[cholesky.SupernodeOf(i, i)]++] = {i, place.data, place.stride};
    }
    // Each start has moved on to the next one's.
    for (auto* start : {&product_start_, &mass_start_}) {
      std::copy_backward(start->begin(), start->end() - 1, start->end());
      start->front() = 0;
    }
  }

  std::span<const Product> products(int supernode) const { return Of(products_, product_start_, supernode); }
  std::span<const Mass> masses(int supernode) const { return Of(masses_, mass_start_, supernode); }

 private:
  template <typename Part>
  static std::span<const Part> Of(const std::vector<Part>& parts, const std::vector<int>& start, int supernode) {
    return std::span(parts).subspan(start[supernode], start[supernode + 1] - start[supernode]);
  }

  std::vector<Product> products_;
  std::vector<Mass> masses_;
  std::vector<int> product_start_, mass_start_;  // per supernode
};

}  // namespace islet::qp
