#include "engine/response/island_problem.h"

#include "engine/rotation.h"
#include "parallel/fork.h"

namespace islet {

qp::Jacobian PointJacobian(const Vector3& position_W, const Contact& contact, const Matrix3& frame, double sign) {
  qp::Jacobian jacobian;
  jacobian.leftCols<3>() = sign * frame.transpose();
  jacobian.rightCols<3>().noalias() = -sign * frame.transpose() * CrossMatrix(contact.point_W - position_W);
  return jacobian;
}

void IslandGatherer::Gather(std::span<const Body> bodies, const ContactFrames& contacts,
                            std::span<const int> island_bodies, std::span<const int> island_contacts,
                            qp::Problem* problem) {
  problem->bodies.clear();
  if (local_.size() < bodies.size()) local_.resize(bodies.size(), -1);
  for (const int number : island_bodies) {
    local_[number] = problem->num_bodies();
    const Body& body = bodies[number];
    qp::BodyTerm term;
    term.mass = body.mass;
    term.inertia = body.InertiaW();
    term.inverse_inertia = body.InverseInertiaW();
    term.velocity << body.linear_velocity_W, body.angular_velocity_W;
    problem->bodies.push_back(term);
  }
  problem->contacts.resize(island_contacts.size());
  parallel::ForkRanges(static_cast<int>(island_contacts.size()), [&](int from, int to) {
    for (int c = from; c < to; ++c) problem->contacts[c] = Term(bodies, contacts, island_contacts[c]);
  });
  for (const int number : island_bodies) local_[number] = -1;
}

qp::ContactTerm IslandGatherer::Term(std::span<const Body> bodies, const ContactFrames& contacts, int number) const {
  const Contact& contact = contacts.contacts[number];
  const Matrix3& frame = contacts.frames[number];
  const Body& a = bodies[contact.body_a];
  const Body& b = bodies[contact.body_b];
  qp::ContactTerm term;
  term.body_a = local_[contact.body_a];
  term.body_b = local_[contact.body_b];
  if (term.body_a >= 0) term.jacobian_a = PointJacobian(a.position_W, contact, frame, -1);
  if (term.body_b >= 0) term.jacobian_b = PointJacobian(b.position_W, contact, frame, 1);
  if (a.kind == BodyKind::kKinematic) term.drift -= frame.transpose() * a.VelocityAt(contact.point_W);
  if (b.kind == BodyKind::kKinematic) term.drift += frame.transpose() * b.VelocityAt(contact.point_W);
  if (!contact.surface_W.isZero(0)) term.drift.tail<2>() += frame.rightCols<2>().transpose() * contact.surface_W;
  term.friction = contact.friction;
  return term;
}

void IslandGatherer::ScatterVelocities(const qp::Solution& solution, std::span<const int> island_bodies,
                                       std::span<Body> bodies) {
  for (size_t i = 0; i < island_bodies.size(); ++i) {
    const double* v = &solution.velocities[6 * i];
    bodies[island_bodies[i]].linear_velocity_W = Vector3(v[0], v[1], v[2]);
    bodies[island_bodies[i]].angular_velocity_W = Vector3(v[3], v[4], v[5]);
  }
}

}  // namespace islet
