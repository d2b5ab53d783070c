// What stands on a wall or a belt whose velocity the user changes. The user gives a wall one velocity for each step, and its pose goes by that,
// as straight as an inertial frame. As that frame sees it, a wall that speeds up by a stands still, and all on it is pulled back by its mass
// times a. So where a step begins what rides is as fast as its wall, and a force takes that back evenly, all through the step. The two cancel,
// whatever happens meanwhile: who leaves the wall has got nothing, and contacts hold against the force by their own law. Where walls turn the
// force turns with them by half of that, since what rides is half a step behind; what it leaves is told as theirs.
//
//   in:      bodies as a step begins, and the forces [N] that held contacts where the one before ended
//   out:     velocities of those that ride, and their forces and torques for this step
//   law:     what stays closed in the step goes along with its wall; what sticks, along the wall, too. Both are
//            known by a rough solve of the whole step, with weight and the user's forces.
//            Contacts may pull here: what they give is taken back
//            What rode as one in the step before and turns now, since it tips, gets all through its centre.
//   They need not be exact: what acts in the end is the impulses of contacts, and those are certified.
//   frames:  W    units: SI    threads: one
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/contact_filter.h"
#include "engine/contact_suite.h"
#include "engine/motion/group/group.h"
#include "engine/response/response.h"
#include "engine/settings.h"
#include "engine/shape.h"
#include "islands/partition.h"

namespace islet::motion {

class Ride {
 public:
  // Whether the user changed the velocity of a wall or belt since the step before; of any.
  static bool Changed(const Body& wall);
  static bool AnyChanged(std::span<const Body> bodies);

  // contacts: where the step before ended, ascending by pair, with the forces [N] that held there, on body_b. Gives what rides its velocity and
  // its forces; what was frozen and rides is awake.
  void Begin(double dt, const Settings& settings, std::span<const Shape> shapes, const ContactFilter& filter,
             const MixMaterial& mix, std::span<const Contact> contacts, std::span<const Vector3> forces_W,
             std::span<Body> bodies);
  // Forces are the user's again. What walls that turn gave and did not take back, since it turned with them, is added to what the step tells:
  // contacts, and [N s] on body_b.
  void End(std::span<Body> bodies, std::vector<Contact>* contacts, std::vector<Vector3>* impulses_W);
  void Clear();  // after a step that did not end

 private:
  struct Rider {
    int body;
    Vector3 force_W, torque_W;  // [N], [N m] the user's
  };
  void Detect(std::span<const int> of_island, const Settings& settings, std::span<const Shape> shapes,
              const ContactFilter& filter, const MixMaterial& mix, std::span<const Contact> contacts,
              std::span<const Vector3> forces_W, std::span<const Body> bodies);
  bool Predict(std::span<const int> members, const Settings& settings, std::span<const Body> bodies);
  bool Load(std::span<const int> members, std::span<const Body> bodies);
  void PoseFree(const Settings& settings, const Body& body, Body* posed) const;
  void PoseChange(const Body& body, Body* posed) const;
  Twist ChangeOf(const Body& wall) const;
  Vector3 ChangeAt(const Contact& contact, std::span<const Body> bodies) const;
  void Weigh(std::span<const int> members, const Settings& settings, std::span<const Body> bodies);
  bool Solve(std::span<const int> members, const Settings& settings);
  bool FindChange(std::span<const Body> bodies);
  bool KeepUpright(std::span<const int> members, const Settings& settings, std::span<Body> bodies);
  Vector3 TurnOfWalls(std::span<const Body> bodies) const;
  Vector3 GivenBy(int c) const;
  void Give(std::span<const int> members, bool upright, std::span<Body> bodies);

  std::vector<Rider> riders_;
  std::vector<Contact> kept_;
  std::vector<Vector3> kept_W_;
  // Of an island: its contacts as the step before ended, and as they are now.
  std::vector<Contact> before_, found_;
  std::vector<Contact> now_;                       // with the friction that they may have
  std::vector<Vector3> before_force_W_, force_W_;  // [N]
  std::vector<Body> posed_;                        // where the step ends; then in changes of velocities alone
  std::vector<Vector3> load_W_, local_;            // [N s] per contact
  std::vector<Matrix3> frames_;
  std::vector<double> targets_;
  std::vector<int> held_;                    // those that hold
  std::vector<Vector3> given_W_, moment_W_;  // [N s], [N m s] per body
  double dt_ = 0;                            // [s]
  double mass_ = 0;                          // [kg] of all of an island
  double floor_ = 0;                         // [m/s] least v_ref of the island
  Twist change_;                             // of all walls of the island, at the origin
  std::vector<bool> rode_, upright_;         // per body: in the step before; now it is not turned against its walls
  std::vector<std::uint8_t> cut_;
  std::vector<std::pair<int, int>> edges_;
  islands::Partition partition_;
  IslandResponder responder_;
};

}  // namespace islet::motion
