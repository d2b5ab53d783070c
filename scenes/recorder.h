// Keeps a run as a film while it goes on: frame 0 at once, then one after each step.
//   errors: of what cannot be recorded at all, or not written at the start: those of FilmWriter (film/film_file.h). Of a later frame: the
//           run goes on without a recording, the standard error tells it at once, and Finish() throws std::runtime_error.
#pragma once

#include "scenes/film/film_file.h"
#include "scenes/ready_scene.h"
#include "scenes/run_options.h"

namespace islet {

// Of a run that begins. The text of a scene's file goes with it, if it is no longer than half of what a head may be.
FilmHead RunHead(const RunOptions& options, const ReadyScene& scene);

class Recorder {
 public:
  Recorder(const RunOptions& options, const ReadyScene& scene);
  void Add(const World& world, const StepReport& report, int frame, double step_seconds);  // [s] wall
  void Finish(const std::string& stopped_by);

 private:
  std::string path_;
  std::string failure_;
  double start_;  // [J] potential energy of frame 0
  FilmWriter writer_;
};

}  // namespace islet
