// A world that runs while somebody changes it: commands are done between steps, never within one.
//
//   threads: one caller at a time    units: SI
//   errors: a command that the world refuses throws std::invalid_argument, and nothing has changed
#pragma once

#include <functional>
#include <optional>

#include "engine/world.h"
#include "scenes/live/command.h"

namespace islet {

class LiveRun {
 public:
  // drive: what the scene does to its world before each step, [s]; may be empty. What is asked for here outlasts it.
  using Drive = std::function<void(double time, World* world)>;
  LiveRun(World world, double dt, Drive drive = {});  // it begins at rest: paused

  void Do(const LiveCommand& command);
  // Makes a step if it runs, or if one was asked for. Returns whether it did.
  bool Advance();

  const World& world() const { return world_; }
  const StepReport& report() const { return report_; }  // of the last step
  double dt() const { return dt_; }
  bool running() const { return running_; }
  int steps() const { return steps_; }
  // How often bodies were added, which changes what a page has to know.
  int generation() const { return generation_; }
  // Whether gravity, friction, a throw or a drag has made it another run than the scene's own.
  bool changed() const { return changed_; }
  // Of all bodies, where it was asked for: before that each has the scene's.
  std::optional<double> friction() const { return friction_; }

 private:
  struct Drag {
    int body;
    Vector3 at_B, to_W;
    Vector3 force_W, torque_W;  // that acted on it before, and will again
  };
  void Throw(const LiveCommand& command);
  void Pull();
  void LetGo();

  World world_;
  double dt_;
  Drive drive_;
  StepReport report_;
  bool running_ = false, step_ = false, changed_ = false;
  int steps_ = 0, generation_ = 0, thrown_ = 0;
  std::optional<Drag> drag_;
  std::optional<Shape> ball_;  // the last that was thrown: those of one size share a shape
  std::optional<Vector3> gravity_W_;
  std::optional<double> friction_;
};

}  // namespace islet
