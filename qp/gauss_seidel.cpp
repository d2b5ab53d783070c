#include "qp/gauss_seidel.h"

#include <algorithm>
#include <cmath>

namespace islet::qp {
namespace {

Eigen::Matrix<double, 6, 3> Response(const BodyTerm& body, const Jacobian& jacobian) {
  Eigen::Matrix<double, 6, 3> response;
  response.topRows<3>() = jacobian.leftCols<3>().transpose() / body.mass;
  response.bottomRows<3>().noalias() = body.inverse_inertia * jacobian.rightCols<3>().transpose();
  return response;
}

}  // namespace

void GaussSeidel::Prepare(const Problem& problem) {
  locals_.resize(problem.contacts.size());
  for (size_t c = 0; c < locals_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    Matrix3 w = DelassusBlock(problem, contact);
    w += contact.compliance * Matrix3::Identity();
    locals_[c].contact = OneContact(w);
    if (contact.body_a >= 0) locals_[c].response_a = Response(problem.bodies[contact.body_a], contact.jacobian_a);
    if (contact.body_b >= 0) locals_[c].response_b = Response(problem.bodies[contact.body_b], contact.jacobian_b);
  }
}

int GaussSeidel::Sweep(const Problem& problem, int max_sweeps, double tolerance, std::vector<Vector3>* impulses,
                       std::vector<double>* velocities) const {
  double* v = velocities->data();
  for (int sweep = 1; sweep <= max_sweeps; ++sweep) {
    double largest = 0;
    for (size_t c = 0; c < locals_.size(); ++c) {
      const ContactTerm& contact = problem.contacts[c];
      const Local& local = locals_[c];
      Vector3& j = (*impulses)[c];
      const Vector3 u = ContactVelocity(contact, v) + contact.compliance * j;
      Vector3 q = u - local.contact.w() * j;
      q[0] -= contact.target;
      const double pull = j[1] * j[1] + j[2] * j[2];
      const double guess = pull > 0 ? std::sqrt((u[1] * u[1] + u[2] * u[2]) / pull) : 0;  // u_t = -lambda j_t
      const Vector3 next = local.contact.SolveCoulomb(q, contact.friction, guess);
      const Vector3 change = next - j;
      j = next;
      if (contact.body_a >= 0) Eigen::Map<Vector6>(v + 6 * contact.body_a).noalias() += local.response_a * change;
      if (contact.body_b >= 0) Eigen::Map<Vector6>(v + 6 * contact.body_b).noalias() += local.response_b * change;
      largest = std::max(largest, change.cwiseAbs().maxCoeff() * local.contact.w()(0, 0));
    }
    if (largest <= tolerance) return sweep;
  }
  return max_sweeps;
}

}  // namespace islet::qp
