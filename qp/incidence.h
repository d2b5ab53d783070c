// Which contacts press on a body: lets bodies gather forces side by side, each in the order of its contacts.
//   threads: Build by one; reading from any number; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/problem.h"

namespace islet::qp {

class Incidence {
 public:
  void Build(const Problem& problem);

  // Sum of J_c^T forces[c] over the body's contacts.
  Vector6 Gather(const Problem& problem, int body, const Vector3* forces) const {
    Vector6 sum = Vector6::Zero();
    for (int p = start_[body]; p < start_[body + 1]; ++p) {
      const ContactTerm& contact = problem.contacts[places_[p].contact];
      const Jacobian& jacobian = places_[p].is_a ? contact.jacobian_a : contact.jacobian_b;
      sum.noalias() += jacobian.transpose() * forces[places_[p].contact];
    }
    return sum;
  }

 private:
  struct Place {
    int contact;
    bool is_a;
  };
  std::vector<int> start_;  // per body, into places_
  std::vector<Place> places_;
};

}  // namespace islet::qp
