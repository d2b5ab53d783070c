// A world that runs while somebody changes it: commands are done between steps, never within one.
//
//   threads: one caller at a time    units: SI
//   errors: a command that the world refuses throws std::invalid_argument, and nothing has changed
#pragma once

#include <cstdint>
#include <optional>

#include "engine/world.h"
#include "scenes/live/command.h"

namespace islet {

class LiveRun {
 public:
  LiveRun(World world, double dt);  // it begins at rest: paused

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

 private:
  struct Drag {
    int body;
    Vector3 at_B, to_W;
  };
  void Throw(const LiveCommand& command);
  void Pull();
  void LetGo();

  World world_;
  double dt_;
  StepReport report_;
  bool running_ = false, step_ = false;
  int steps_ = 0, generation_ = 0, thrown_ = 0;
  std::optional<Drag> drag_;
};

}  // namespace islet
