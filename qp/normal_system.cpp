#include "qp/normal_system.h"

#include <algorithm>
#include <numeric>

namespace islet::qp {
namespace {

constexpr double kNoLever = 1e-13;  // times the radius of gyration: rounding

// Whether a normal impulse turns the body.
bool Turns(const BodyTerm& body, const Jacobian& jacobian) {
  const Vector3 lever = jacobian.row(0).tail<3>().transpose();
  return body.mass * lever.squaredNorm() > kNoLever * kNoLever * body.inertia.trace();
}

// Numbers of the parts that each supernode has, and where they begin.
void CountToStart(std::vector<int>* count) { std::exclusive_scan(count->begin(), count->end(), count->begin(), 0); }

}  // namespace

void NormalSystem::Prepare(const Problem& problem) {
  const int nc = problem.num_contacts();
  normals_.resize(12 * static_cast<size_t>(nc));
  width_ = 3;
  for (int c = 0; c < nc; ++c) {
    const ContactTerm& contact = problem.contacts[c];
    for (int i = 0; i < 6; ++i) {
      normals_[12 * c + i] = contact.jacobian_a(0, i);
      normals_[12 * c + 6 + i] = contact.jacobian_b(0, i);
    }
    if (contact.body_a >= 0 && Turns(problem.bodies[contact.body_a], contact.jacobian_a)) width_ = 6;
    if (contact.body_b >= 0 && Turns(problem.bodies[contact.body_b], contact.jacobian_b)) width_ = 6;
  }
  inertias_.clear();
  masses_.clear();
  for (const BodyTerm& body : problem.bodies) {
    inertias_.push_back(body.inertia);
    masses_.push_back(body.mass);
  }
  FindPairs(problem);
  cholesky_.Analyse(problem.num_bodies(), width_, pairs_);
  ListParts(problem);
}

void NormalSystem::FindPairs(const Problem& problem) {
  pairs_.clear();
  for (const ContactTerm& contact : problem.contacts) {
    if (contact.body_a < 0 || contact.body_b < 0) continue;
    pairs_.push_back({std::min(contact.body_a, contact.body_b), std::max(contact.body_a, contact.body_b)});
  }
  std::sort(pairs_.begin(), pairs_.end());
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
}

void NormalSystem::ListParts(const Problem& problem) {
  const int supernodes = cholesky_.elimination().num_supernodes();
  product_start_.assign(supernodes + 1, 0);
  mass_start_.assign(supernodes + 1, 0);
  // A pair's block is asked for with the body first whose rows it holds.
  const auto each_product = [&](const auto& add) {
    for (int c = 0; c < problem.num_contacts(); ++c) {
      const int a = problem.contacts[c].body_a, b = problem.contacts[c].body_b;
      const double *of_a = &normals_[12 * static_cast<size_t>(c)], *of_b = of_a + 6;
      if (a >= 0) add(a, a, Product{c, nullptr, 0, of_a, of_a});
      if (b >= 0) add(b, b, Product{c, nullptr, 0, of_b, of_b});
      if (a >= 0 && b >= 0) add(a, b, Product{c, nullptr, 0, of_a, of_b});
    }
  };
  each_product([&](int i, int j, const Product&) { ++product_start_[cholesky_.SupernodeOf(i, j)]; });
  for (int i = 0; i < problem.num_bodies(); ++i) ++mass_start_[cholesky_.SupernodeOf(i, i)];
  CountToStart(&product_start_);
  CountToStart(&mass_start_);
  products_.resize(product_start_.back());
  mass_places_.resize(mass_start_.back());
  each_product([&](int i, int j, Product product) {
    const BlockPlace place = cholesky_.BlockAt(i, j);
    product.to = place.data;
    product.stride = place.stride;
    if (place.transposed) std::swap(product.left, product.right);
    products_[product_start_[cholesky_.SupernodeOf(i, j)]++] = product;
  });
  for (int i = 0; i < problem.num_bodies(); ++i) {
    const BlockPlace place = cholesky_.BlockAt(i, i);
    mass_places_[mass_start_[cholesky_.SupernodeOf(i, i)]++] = {i, place.data, place.stride};
  }
  // Each start has moved on to the next one's.
  for (auto* start : {&product_start_, &mass_start_}) {
    std::copy_backward(start->begin(), start->end() - 1, start->end());
    start->front() = 0;
  }
}

int NormalSystem::Factorise(const std::vector<double>& sigma) {
  static constexpr double kSigns[6] = {1, 1, 1, 1, 1, 1};
  return cholesky_.Factorise({kSigns, static_cast<size_t>(width_)}, [&](int s) {
    for (int p = mass_start_[s]; p < mass_start_[s + 1]; ++p) {
      const Mass& part = mass_places_[p];
      const auto at = [&](int row, int column) -> double& {
        return part.to[row + static_cast<ptrdiff_t>(column) * part.stride];
      };
      for (int i = 0; i < 3; ++i) at(i, i) += masses_[part.body];
      for (int i = 3; i < width_; ++i)
        for (int j = 3; j < width_; ++j) at(i, j) += inertias_[part.body](i - 3, j - 3);
    }
    for (int p = product_start_[s]; p < product_start_[s + 1]; ++p) {
      const Product& part = products_[p];
      if (sigma[part.contact] == 0) continue;
      for (int j = 0; j < width_; ++j) {
        const double right = sigma[part.contact] * part.right[j];
        double* column = part.to + static_cast<ptrdiff_t>(j) * part.stride;
        for (int i = 0; i < width_; ++i) column[i] += part.left[i] * right;
      }
    }
  });
}

}  // namespace islet::qp
