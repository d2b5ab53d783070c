#include "qp/planar_system.h"

#include <algorithm>
#include <numeric>

namespace islet::qp {
namespace {

void CountToStart(std::vector<int>* count) { std::exclusive_scan(count->begin(), count->end(), count->begin(), 0); }

}  // namespace

void PlanarSystem::FindPairs(const Problem& problem) {
  pairs_.clear();
  for (const ContactTerm& contact : problem.contacts) {
    if (contact.body_a < 0 || contact.body_b < 0) continue;
    pairs_.push_back({std::min(contact.body_a, contact.body_b), std::max(contact.body_a, contact.body_b)});
  }
  std::sort(pairs_.begin(), pairs_.end());
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
}

void PlanarSystem::Prepare(const Problem& problem, double mass_scale) {
  const int nb = problem.num_bodies(), nc = problem.num_contacts();
  rows_.clear();
  for (const ContactTerm& contact : problem.contacts)
    for (const Jacobian* j : {&contact.jacobian_a, &contact.jacobian_b})
      rows_.push_back({{(*j)(0, 0), (*j)(0, 1), (*j)(0, 5)}, {(*j)(1, 0), (*j)(1, 1), (*j)(1, 5)}});
  FindPairs(problem);
  cholesky_.Analyse(nb, 3, pairs_);
  const int supernodes = cholesky_.elimination().num_supernodes();
  product_start_.assign(supernodes + 1, 0);
  mass_start_.assign(supernodes + 1, 0);
  // A pair's block is asked for with the body first whose rows it holds.
  const auto each_product = [&](const auto& add) {
    for (int c = 0; c < nc; ++c) {
      const int a = problem.contacts[c].body_a, b = problem.contacts[c].body_b;
      if (a >= 0) add(a, a, Product{c, 2 * c, 2 * c, nullptr, 0});
      if (b >= 0) add(b, b, Product{c, 2 * c + 1, 2 * c + 1, nullptr, 0});
      if (a >= 0 && b >= 0) add(a, b, Product{c, 2 * c, 2 * c + 1, nullptr, 0});
    }
  };
  each_product([&](int i, int j, const Product&) { ++product_start_[cholesky_.SupernodeOf(i, j)]; });
  for (int i = 0; i < nb; ++i) ++mass_start_[cholesky_.SupernodeOf(i, i)];
  CountToStart(&product_start_);
  CountToStart(&mass_start_);
  products_.resize(product_start_.back());
  masses_.resize(mass_start_.back());
  each_product([&](int i, int j, Product product) {
    const BlockPlace place = cholesky_.BlockAt(i, j);
    product.to = place.data;
    product.stride = place.stride;
    if (place.transposed) std::swap(product.left, product.right);
    products_[product_start_[cholesky_.SupernodeOf(i, j)]++] = product;
  });
  for (int i = 0; i < nb; ++i) {
    const BlockPlace place = cholesky_.BlockAt(i, i);
    const BodyTerm& body = problem.bodies[i];
    masses_[mass_start_[cholesky_.SupernodeOf(i, i)]++] = {mass_scale * body.mass, mass_scale * body.inertia(2, 2),
                                                           place.data, place.stride};
  }
  // Each start has moved on to the next one's.
  for (auto* start : {&product_start_, &mass_start_}) {
    std::copy_backward(start->begin(), start->end() - 1, start->end());
    start->front() = 0;
  }
}

int PlanarSystem::Factorise(const std::vector<Matrix3>& d) {
  static constexpr double kSigns[3] = {1, 1, 1};
  return cholesky_.Factorise({kSigns, 3}, [&](int s) {
    for (int p = mass_start_[s]; p < mass_start_[s + 1]; ++p) {
      const Mass& part = masses_[p];
      part.to[0] += part.mass;
      part.to[1 + static_cast<ptrdiff_t>(part.stride)] += part.mass;
      part.to[2 + 2 * static_cast<ptrdiff_t>(part.stride)] += part.inertia;
    }
    for (int p = product_start_[s]; p < product_start_[s + 1]; ++p) {
      const Product& part = products_[p];
      const Row &left = rows_[part.left], &right = rows_[part.right];
      const double* const block = d[part.contact].data();  // symmetric
      const double nn = block[0], nt = block[1], tt = block[4];
      for (int j = 0; j < 3; ++j) {
        const double n = nn * right.n[j] + nt * right.t[j], t = nt * right.n[j] + tt * right.t[j];
        double* const column = part.to + static_cast<ptrdiff_t>(j) * part.stride;
        for (int i = 0; i < 3; ++i) column[i] += left.n[i] * n + left.t[i] * t;
      }
    }
  });
}

}  // namespace islet::qp
