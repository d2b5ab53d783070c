// Bodies that move as one are carried as one: a smaller problem with the same answer.
//
//   bound     two bodies with at least three contacts that pressed in the frame before, strictly inside their cones (so
//             they stuck), and that the impulses of then keep together
//   cluster   bodies that bound pairs join; walls join nothing, so that a cluster may ride on a wall that moves as it likes
//   reduced   one body a cluster (mass, inertia about the joint centre, velocity with the joint momentum), the contacts
//             between clusters and with walls
//   expand    from the reduced answer: velocities of all bodies, and those impulses inside the clusters, nearest to the ones
//             of the frame before, that give each body its share of the motion
//   split     where there are none: clusters come apart at the pairs that bar the way to them
//
// Positions are no part of a problem: lever arms are read off the Jacobians, and where these are not those of points on rigid
// bodies nothing is bound. Whether clusters do hold together is for the caller to judge, by the law at all contacts.
//   threads: one caller at a time, idle workers help with the factorisation; allocates only while problems grow
#pragma once

#include <array>
#include <span>
#include <vector>

#include "qp/kkt.h"
#include "qp/problem.h"

namespace islet::qp {

class Compounds {
 public:
  // start: impulses of the frame before. velocities: those that they lead to. velocity_scale: v_ref.
  // Returns whether few enough bodies remain in reduced(): at most half and 8, and no more than two or about a third.
  bool Find(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& velocities,
            double velocity_scale);

  const Problem& reduced() const { return reduced_; }
  std::span<const Vector3> reduced_start() const { return reduced_start_; }

  // After Find, for the same problem: velocities and impulses of all, from those of the reduced problem. goal: [velocity] that
  // they are good to. False where no impulses inside the cones were found: the clusters do not hold together.
  bool Expand(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& reduced_velocities,
              std::span<const Vector3> reduced_impulses, double goal, std::vector<Vector3>* impulses,
              std::vector<double>* velocities);

  // After an Expand that was false: lets go of the pairs that the impulses inside would have left their cones at first. False
  // where as many clusters remain as half of the bodies or more (two of four will do), or more than 8, or nothing came loose; else all is as after Find.
  bool Split(const Problem& problem, std::span<const Vector3> start);

  // Whether the clusters meet at so many contacts that the reduced impulses are one answer of many.
  bool crowded() const;
  int factorisations() const { return factorisations_; }  // since Find

 private:
  struct Bond {  // one bound contact
    int a, b, contact;
  };
  void FindBonds(const Problem& problem, std::span<const Vector3> start, const std::vector<double>& velocities,
                 double velocity_scale);
  int Root(int body);
  bool Reduce(const Problem& problem, std::span<const Vector3> start, size_t most);
  bool Join(const Problem& problem);
  void NumberClusters(const Problem& problem);
  void ReduceBodies(const Problem& problem);
  void ReduceContacts(const Problem& problem, std::span<const Vector3> start);
  bool IsInner(const ContactTerm& contact) const;
  void FindSticking(const Problem& problem, const std::vector<double>& velocities, double goal);
  void BeginInside(const Problem& problem, std::span<const Vector3> start, bool grow, std::vector<Vector3>* impulses);
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
  std::vector<int> outer_, sticking_;  // contacts: of the reduced problem; those that do not move
  Problem inside_;                     // all bodies, sticking contacts
  std::vector<double> weights_;        // per sticking contact: 1 / W
  std::vector<Vector3> borne_;         // per sticking contact: its impulse
  KktSystem system_;
  std::vector<std::array<double, 2>> loads_;  // per cluster: normal impulses from outside, before and now
  std::vector<Matrix3> blocks_;               // per sticking contact
  std::vector<Vector3> begin_;
  std::vector<Vector3> changes_;               // per sticking contact
  std::vector<double> lengths_;                // per sticking contact: how much of the last step its cone allowed
  std::vector<double> missing_, multipliers_;  // 6 per body
};

}  // namespace islet::qp
