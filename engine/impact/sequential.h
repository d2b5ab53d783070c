// Step 1: partial sequential collision resolution (PQ). The fastest collision first, one at a time, until all contacts
// separate or the bounce limit is reached; what is left goes to the collision QP.                     [SM04 Sec. 5.1]
//
// Contacts that tie for the fastest bounce at once, however many, by a Coulomb problem of their own: a cube that lands flat does not
// spin, a tray of glasses stops with them, and a symmetric hit stays symmetric.
//
//   in:  one group of bodies joined by contacts (the suite cuts at fixed bodies only, and frozen ones bounce; for crowds frozen ones are walls)
//   out: velocities of the group's bodies and the impulses, written in place
//   threads: one resolver per worker; groups share no body that moves
//   allocation: none after warm-up
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/body.h"
#include "engine/impact/bounce.h"
#include "engine/impact/contact_queue.h"
#include "engine/response/island_problem.h"
#include "engine/settings.h"
#include "qp/cascade/island_solver.h"

namespace islet {

// c_b of a group: the given limit, or the paper's heuristic. The automatic limit of exact bounces is each body's own: two, or who only
// touches would change what a blow does.                                                              [SM04 Sec. 5.1]
int BounceLimit(int setting, int num_bodies, int num_contacts);

// Which contacts of a group bounce, and how often.
struct BounceRule {
  double threshold;                      // [m/s] > 0; a contact collides if it approaches faster
  int limit = kAutoBounceLimit;          // c_b, or by BounceLimit
  bool walls_answer = false;             // what rests on an immovable body takes a blow with it, not before it
  std::span<const double> resting = {};  // [m/s] per contact of the world: what is no faster rests; empty: threshold
  std::span<const double> least_rebound = {};  // [m/s] per contact of the world: a slower one is none; empty: all do
  double time = INFINITY;                      // [s] in which what is open may close
  double tie = 0;  // of the fastest: by how much approaches of a body that come at once may differ
};

class SequentialResolver {
 public:
  // impulses: [N s] per contact of the world, (n, t1, t2), added to. Returns the number of bounces.
  int Resolve(std::span<const int> group_bodies, std::span<const int> group_contacts, const ContactFrames& contacts,
              BounceLaw law, const BounceRule& rule, std::span<Body> bodies, std::span<Vector3> impulses);

 private:
  void Load(std::span<const int> group_bodies, std::span<const int> group_contacts, const ContactFrames& contacts,
            std::span<const Body> bodies);
  double NormalVelocityOf(int local_contact, const Contact& contact) const;
  bool Answers(int local_contact, int number, double velocity) const;
  void FindTies(std::span<const int> group_contacts, std::span<const Contact> contacts);
  void GatherTies(std::span<const int> group_contacts, const ContactFrames& contacts);
  double SolveTies(std::span<const int> group_contacts, std::span<const Contact> contacts, double friction_share);
  bool LowerFriction(std::span<const int> group_contacts, std::span<const Contact> contacts);
  bool BounceTogether(std::span<const int> group_contacts, const ContactFrames& contacts, std::span<Vector3> impulses);
  void ApplyAt(int local_contact, const Contact& contact, const Vector3& impulse_W);
  double Rebound(int number, const Contact& contact, double approach) const;
  bool IsSpent(int local_contact) const;
  void Requeue(std::span<const int> group_contacts, std::span<const Contact> contacts);

  std::vector<int> local_;                  // world body -> place in the group
  std::vector<BounceBody> locals_;          // the group's bodies, then one per immovable body that it touches
  std::vector<std::pair<int, int>> sides_;  // per contact of the group: its two bodies
  std::vector<int> touch_start_, touches_;  // per body: contacts of the group
  double threshold_ = 0;                    // [m/s]
  bool walls_answer_ = false;
  std::span<const double> resting_, least_rebound_;  // of the rule, while Resolve runs
  double tie_ = 0, time_ = INFINITY;
  std::vector<double> keys_;
  ContactQueue queue_;
  std::vector<int> tied_, tied_bodies_;  // contacts that bounce next, and the places of their bodies that move
  std::vector<std::uint8_t> in_tie_;     // per contact
  std::vector<std::uint8_t> is_tied_;    // per body
  std::vector<int> place_;               // of it in the problem of what is tied
  bool by_body_ = false;
  std::vector<double> spent_;  // per body: of the limit
  qp::Problem tied_problem_;
  qp::Solution tied_solution_;
  qp::IslandSolver tie_solver_;
};

}  // namespace islet
