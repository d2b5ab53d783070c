// Static impulses where they acted: v1 came from the contacts at the start of the step, but they act throughout it, while
// points and normals move. Once the step's end is known, each impulse becomes the mean of the two ends, and the velocities
// change by the difference. With x += dt (v0 + v1) / 2 that is velocity Verlet: a body that rocks in a valley keeps its energy
// (with the start's normals alone it gains w^2 dt / 2 of it per second), and angular momentum stays what it was, since both
// bodies take the impulse at one point, halfway along the step.
//
//   in:  contacts and static impulses at the start, contacts at the end; where bodies started and how fast
//   out: velocities; the changes of the impulses. Linear momentum changes by what is reported, to rounding
//   order: canonical on both sides; serial, since a frozen body may belong to many islands
#pragma once

#include <span>
#include <vector>

#include "engine/contact_suite.h"

namespace islet {

struct StepStart {
  double dt = 0;                      // [s]
  std::span<const Twist> velocities;  // per body, before gravity
  std::span<const Vector3> positions_W;
};

class MidstepImpulses {
 public:
  // impulses: [N s] (n, t1, t2) that held at `before`. Bodies are at the end of the step; those in `stopped` did not get there
  // by their velocity, so theirs stay as they are.
  void Move(const StepStart& start, std::span<const Contact> before, std::span<const Vector3> impulses,
            std::span<const Contact> after, std::span<const std::uint8_t> stopped, std::span<Body> bodies);

  std::span<const Vector3> changes() const { return changes_; }  // [N s] per contact of `before`, on body_b, W

 private:
  struct Change {
    Vector3 linear = Vector3::Zero();   // [N s]
    Vector3 angular = Vector3::Zero();  // [N m s] about the centre
  };
  struct Acting {
    Vector3 point_W, impulse_W;
  };
  Acting EndOf(const StepStart& start, const Contact& before, const Vector3& impulse_W, std::span<const Contact> after,
               std::span<const Body> bodies) const;

  std::vector<Vector3> changes_;
  std::vector<Change> sums_;  // per body
};

}  // namespace islet
