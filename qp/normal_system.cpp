#include "qp/normal_system.h"

namespace islet::qp {
namespace {

constexpr double kNoLever = 1e-13;  // times the radius of gyration: rounding

// Whether a normal impulse turns the body.
bool Turns(const BodyTerm& body, const Jacobian& jacobian) {
  const Vector3 lever = jacobian.row(0).tail<3>().transpose();
  return body.mass * lever.squaredNorm() > kNoLever * kNoLever * body.inertia.trace();
}

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
  FindBodyPairs(problem, &pairs_);
  cholesky_.Analyse(problem.num_bodies(), width_, pairs_);
  parts_.List(problem, cholesky_, [&](int c, int side) { return &normals_[12 * static_cast<size_t>(c) + 6 * side]; });
}

int NormalSystem::Factorise(const std::vector<double>& sigma) {
  return width_ == 3 ? FactoriseIn<3>(sigma) : FactoriseIn<6>(sigma);
}

template <int kWidth>
int NormalSystem::FactoriseIn(const std::vector<double>& sigma) {
  static constexpr double kSigns[6] = {1, 1, 1, 1, 1, 1};
  return cholesky_.Factorise({kSigns, static_cast<size_t>(kWidth)}, [&](int s) {
    for (const auto& part : parts_.masses(s)) {
      const auto at = [&](int row, int column) -> double& {
        return part.to[row + static_cast<ptrdiff_t>(column) * part.stride];
      };
      for (int i = 0; i < 3; ++i) at(i, i) += masses_[part.body];
      for (int i = 3; i < kWidth; ++i)
        for (int j = 3; j < kWidth; ++j) at(i, j) += inertias_[part.body](i - 3, j - 3);
    }
    for (const auto& part : parts_.products(s)) {
      if (sigma[part.contact] == 0) continue;
      for (int j = 0; j < kWidth; ++j) {
        const double right = sigma[part.contact] * part.right[j];
        double* column = part.to + static_cast<ptrdiff_t>(j) * part.stride;
        for (int i = 0; i < kWidth; ++i) column[i] += part.left[i] * right;
      }
    }
  });
}

}  // namespace islet::qp
