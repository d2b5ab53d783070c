#include "qp/incidence.h"

namespace islet::qp {

void Incidence::Build(const Problem& problem) {
  const int nb = problem.num_bodies();
  start_.assign(nb + 2, 0);  // shifted by one while it is filled
  for (const ContactTerm& c : problem.contacts)
    for (const int body : {c.body_a, c.body_b})
      if (body >= 0) ++start_[body + 2];
  for (int i = 2; i <= nb + 1; ++i) start_[i] += start_[i - 1];
  places_.resize(start_[nb + 1]);
  for (int c = 0; c < problem.num_contacts(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    if (contact.body_a >= 0) places_[start_[contact.body_a + 1]++] = {c, true};
    if (contact.body_b >= 0) places_[start_[contact.body_b + 1]++] = {c, false};
  }
}

}  // namespace islet::qp
