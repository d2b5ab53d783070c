// What rides on a wall whose velocity the user changes feels that as a force of the whole step, not as a blow at its start. A wall's velocity
// is that of the middle of a step. Where two steps meet it is halfway between theirs, and so is that of what it carries.
//
//   in:      bodies and contacts where a step begins, with the forces [N] that held there
//   out:     impulses J0 at these contacts, which give their bodies half of the change; the piece takes them back where it ends, when J
//            of all that acted is known
//   law:     J0 rubs no more than the forces that held allow in half a step, and nothing that slid, or will. It may pull: J may not, and
//            where what rode is open as the piece ends those that it held together go without
//   They need not be exact: what acts in the end is J, and that is certified.
//   frames:  W    units: SI
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "engine/body.h"
#include "engine/contact.h"
#include "engine/response/response.h"
#include "engine/settings.h"
#include "islands/partition.h"

namespace islet::motion {

// [m/s] by which the user changed the velocity of b's surface against a's at a point since the step before.
Vector3 SurfaceChange(const Body& a, const Body& b, const Vector3& point_W);

class Ride {
 public:
  // pull: [m/s^2] fastest that forces make a body. Walls that come, go or pass by faster than that, or its friction, are not followed: they
  // strike, leave or rub. floor: [m/s] least v_ref.
  // Returns whether anything rides on what changed.
  bool Find(double h, double pull, double floor, const Settings& settings, std::span<const Body> bodies,
            std::span<const Contact> contacts, std::span<const Vector3> forces_W, IslandResponder* responder);
  void Clear() { impulses_W_.clear(); }
  // Takes it from all that ride together with a contact.
  void Drop(size_t contact);
  bool any() const { return !impulses_W_.empty(); }
  // [N s] on body_b of a contact; zero: it does not ride.
  Vector3 impulse_W(size_t contact) const { return any() ? impulses_W_[contact] : Vector3(Vector3::Zero()); }

 private:
  std::vector<Vector3> impulses_W_;  // per contact, or none
  std::vector<Body> posed_;
  std::vector<Contact> held_;
  std::vector<int> held_of_;  // places of these
  std::vector<Matrix3> frames_;
  std::vector<Vector3> before_W_, local_;
  std::vector<double> targets_;
  std::vector<std::uint8_t> cut_;
  std::vector<std::pair<int, int>> edges_;
  islands::Partition partition_;
};

}  // namespace islet::motion
