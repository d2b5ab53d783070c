// What a scene file lets act over time: forces, the motion of kinematic bodies, gravity.
//
//   in:  a made scene, its description      effect: Apply() sets forces, velocities and gravity of the world for the next step
//   rule: forces, velocities and gravity hold their value of the middle of the step for the whole step; poses are met at its end
//   errors: std::invalid_argument that names the place in the file
//   threads: one world, one caller
#pragma once

#include <vector>

#include "scenes/file/placing.h"
#include "scenes/file/scene_description.h"
#include "scenes/file/scene_maker.h"

namespace islet {

class Drives {
 public:
  Drives(const SceneDescription& description, const MadeScene& made);

  void Apply(double time, double dt, World* world) const;  // [s] at the beginning of the step

 private:
  struct Driven {
    int body;
    size_t drive;               // in drives_
    Pose start;                 // of the body
    Vector3 force_W, torque_W;  // that act besides
  };

  std::vector<DriveEntry> drives_;
  std::vector<Driven> driven_;
};

}  // namespace islet
