// One island -> qp::Problem, and the answer -> bodies. The order of unknowns lives here only.
//
//   gather   const bodies and contacts; frozen, fixed and kinematic bodies are immovable, their motion goes into `drift`
//   scatter  writes the velocities of the island's own bodies and nothing else
//   threads: one gatherer per worker, idle ones help; islands share no body that moves, so tasks never write to the same place
#pragma once

#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "qp/problem.h"
#include "qp/solution.h"

namespace islet {

// What the stages of one frame share, all in canonical order.
struct ContactFrames {
  std::span<const Contact> contacts;
  std::span<const Matrix3> frames;  // ContactFrame of each: columns (n, t1, t2)
};

// Velocity of a body's point at the contact, in the contact frame, times sign: sign F^T (v + omega x r).
qp::Jacobian PointJacobian(const Vector3& position_W, const Contact& contact, const Matrix3& frame, double sign);

class IslandGatherer {
 public:
  // Which bodies of the world the next problems are about; ascending.
  void Gather(std::span<const Body> bodies, const ContactFrames& contacts, std::span<const int> island_bodies,
              std::span<const int> island_contacts, qp::Problem* problem);

  static void ScatterVelocities(const qp::Solution& solution, std::span<const int> island_bodies,
                                std::span<Body> bodies);

 private:
  qp::ContactTerm Term(std::span<const Body> bodies, const ContactFrames& contacts, int number) const;

  std::vector<int> local_;  // world body -> place in the island, -1 elsewhere
};

}  // namespace islet
