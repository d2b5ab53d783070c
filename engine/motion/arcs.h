// Walls that turn around a place that goes evenly. The user gives a wall one velocity for each step, that of the chord between two poses. How it
// changes from step to step tells where that place is, and the wall goes around it on an arc: a parabola.
//
//   in:      bodies as a step begins, with their velocities in the one before
//   out:     Body::arc_W while the step is under way, beyond_before_W after it
//   law:     engine/motion/README.md, Arc. What rolls evenly goes straight
//   frames:  W    units: SI    threads: one
#pragma once

#include <span>
#include <vector>

#include "engine/body.h"
#include "engine/linear_algebra.h"

namespace islet::motion {

class Arcs {
 public:
  // before: [s] length of the step before.
  void Begin(double dt, double before, std::span<Body> bodies);
  // From t on, for this long [s], walls go with the velocity of that part of their arcs.
  void Follow(double t, double duration, std::span<Body> bodies) const;
  // Velocities are the user's again, and those of the step before for the next.
  void End(std::span<Body> bodies);
  void Clear() { walls_.clear(); }  // after a step that did not end

 private:
  struct Wall {
    int body;
    Vector3 velocity_W, arc_W;  // [m/s] of the whole chord; [m/s^2]
  };
  double dt_ = 0;  // [s]
  std::vector<Wall> walls_;
};

}  // namespace islet::motion
