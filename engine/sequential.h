// Step 1: partial sequential collision resolution (PQ). The fastest collision first, one at a time, until all contacts
// separate or the bounce limit is reached; what is left goes to the collision QP.                      [SM04 Sec. 5.1]
//
//   in:  one group of bodies joined by contacts (cut at fixed bodies only: frozen ones bounce like dynamic ones)
//   out: velocities of the group's bodies and the impulses, written in place
//   threads: one resolver per worker; groups share no body that moves
//   allocation: none after warm-up
#pragma once

#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/bounce.h"
#include "engine/contact_queue.h"
#include "engine/island_problem.h"
#include "engine/settings.h"

namespace islet {

// c_b of a group: the given limit, or the paper's heuristic.                                         [SM04 Sec. 5.1]
int BounceLimit(int setting, int num_bodies, int num_contacts);

class SequentialResolver {
 public:
  // threshold: [m/s] > 0; a contact collides if it approaches faster. impulses: [N s] per contact of the world, (n, t1, t2),
  // added to. Returns the number of bounces.
  int Resolve(std::span<const int> group_bodies, std::span<const int> group_contacts, const ContactFrames& contacts,
              const Settings& settings, double threshold, std::span<Body> bodies, std::span<Vector3> impulses);

 private:
  void Load(std::span<const int> group_bodies, std::span<const int> group_contacts, const ContactFrames& contacts,
            std::span<const Body> bodies);
  double NormalVelocityOf(int local_contact, const Contact& contact) const;

  std::vector<int> local_;                  // world body -> place in the group
  std::vector<BounceBody> locals_;          // the group's bodies, then one per immovable body that it touches
  std::vector<std::pair<int, int>> sides_;  // per contact of the group: its two bodies
  std::vector<int> touch_start_, touches_;  // per body: contacts of the group
  std::vector<double> keys_;
  ContactQueue queue_;
};

}  // namespace islet
