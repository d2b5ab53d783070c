#include "qp/planar_system.h"

namespace islet::qp {

void PlanarSystem::Prepare(const Problem& problem, double mass_scale) {
  rows_.clear();
  for (const ContactTerm& contact : problem.contacts)
    for (const Jacobian* j : {&contact.jacobian_a, &contact.jacobian_b})
      rows_.push_back({{(*j)(0, 0), (*j)(0, 1), (*j)(0, 5)}, {(*j)(1, 0), (*j)(1, 1), (*j)(1, 5)}});
  masses_.clear();
  for (const BodyTerm& body : problem.bodies)
    masses_.push_back({mass_scale * body.mass, mass_scale * body.inertia(2, 2)});
  FindBodyPairs(problem, &pairs_);
  cholesky_.Analyse(problem.num_bodies(), 3, pairs_);
  parts_.List(problem, cholesky_, [](int c, int side) { return 2 * c + side; });
}

int PlanarSystem::Factorise(const std::vector<Matrix3>& d) {
  static constexpr double kSigns[3] = {1, 1, 1};
  return cholesky_.Factorise({kSigns, 3}, [&](int s) {
    for (const auto& part : parts_.masses(s)) {
      const auto& [mass, inertia] = masses_[part.body];
      part.to[0] += mass;
      part.to[1 + static_cast<ptrdiff_t>(part.stride)] += mass;
      part.to[2 + 2 * static_cast<ptrdiff_t>(part.stride)] += inertia;
    }
    for (const auto& part : parts_.products(s)) {
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
