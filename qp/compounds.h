// Bodies that move as one are carried as one: a smaller problem with the same answer.
//
//   bound     two bodies with at least three contacts that pressed in the frame before, strictly inside their cones (so
//             they stuck), and that the impulses of then keep together
//   cluster   bodies that bound pairs join; walls join nothing, so that a cluster may ride on a wall that moves as it likes
//   reduced   one body a cluster (mass, inertia about the joint centre, velocity with the joint momentum), the contacts
//             between clusters and with walls
//   expand    from the reduced answer: velocities of all bodies, and those impulses inside the clusters, nearest to the ones
//             of the frame before, that give each body its share of the motion
//
// Positions are no part of a problem: lever arms are read off the Jacobians, and where these are not those of points on rigid
// bodies nothing is bound. Whether clusters do hold together is for the caller to judge, by the law at all contacts.
//   threads: one caller at a time, idle workers help with the factorisation; allocates only while problems grow
#pragma once

#include <span>
#include <vector>

#include "qp/kkt.h"
#include "qp/problem.h"

namespace islet::qp {

class Compounds {
 public:
  // start: impulses of the frame before, in their cones. velocities: those that they lead to. velocity_scale: v_ref.
  // Returns whether at most half of the bodies remain in reduced().
  bool Find(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& velocities,
            double velocity_scale);

  const Problem& reduced() const { return reduced_; }
  std::span<const Vector3> reduced_start() const { return reduced_start_; }

  // After Find, for the same problem: whether the clusters look as if they held together under the impulses of before.
  // impulses: `start`; those inside the clusters move to where Expand goes on.
  bool Try(const Problem& problem, std::vector<Vector3>* impulses);

  // After Try: impulses hold `start` and get what the reduced answer makes of them; velocities too.
  // goal: [velocity] what inner contacts may move by. False where the impulses inside would have to leave their cones.
  bool Expand(const Problem& problem, const std::vector<double>& reduced_velocities,
              std::span<const Vector3> reduced_impulses, double goal, std::vector<Vector3>* impulses,
              std::vector<double>* velocities);

  int factorisations() const { return factorisations_; }  // since Find

 private:
  struct Bond {  // one bound contact
    int a, b, contact;
  };
  void FindBonds(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& velocities,
                 double velocity_scale);
  int Root(int body);
  bool Join(const Problem& problem);
  void NumberClusters(const Problem& problem);
  void ReduceBodies(const Problem& problem);
  void ReduceContacts(const Problem& problem, std::span<const Vector3> start);
  void SpreadVelocities(const std::vector<double>& of_clusters, std::vector<double>* velocities) const;
  void MoveInside(std::vector<Vector3>* impulses);
  double MissingMomentum(const Problem& problem, const std::vector<double>& velocities,
                         const std::vector<Vector3>& impulses);
  void Step(std::vector<Vector3>* impulses);

  int factorisations_ = 0;
  std::vector<Bond> bonds_;        // by pair
  std::vector<int> parent_;        // per body: union-find, then its cluster
  std::vector<Vector3> position_;  // per body: from its parent, then from its cluster's centre
  std::vector<Vector3> centres_;   // per cluster, while it is put together
  Problem reduced_;
  std::vector<Vector3> reduced_start_;
  std::vector<int> outer_, inner_;  // contacts: of the reduced problem; inside clusters, if they pressed
  Problem inside_;                  // all bodies, inner contacts
  std::vector<double> weights_;     // per inner contact: 1 / W
  KktSystem system_;
  std::vector<Matrix3> blocks_;                          // per inner contact
  std::vector<Vector3> changes_;                         // per inner contact
  std::vector<double> reduced_velocities_, velocities_;  // while trying
  std::vector<double> missing_, multipliers_;            // 6 per body
};

}  // namespace islet::qp
