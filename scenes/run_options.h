// What `islet run` was asked for: the options as given, their checks, and the engine settings they amount to.
//
//   errors: std::invalid_argument that names the option and its value
//   rule: --paper first sets everything as in the paper; every option given beside it overrides that, wherever it
//   stands
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/settings.h"
#include "scenes/scene.h"

namespace CLI {
class App;
}

namespace islet {

struct RunOptions {
  std::string scene;
  std::optional<std::string> scene_text;  // of a scene file: in place of what stands in it now
  SceneParameters parameters;

  std::optional<int> frames;      // stop after so many frames
  std::optional<double> seconds;  // [s] or after so much simulated time; neither: at rest, or at the time limit
  std::optional<double> dt;       // [s] absent: the scene's own

  std::optional<int> threads;                                                            // 0: all cores
  std::optional<std::string> model, cone, effort, ladder, bounce, bounce_limit, freeze;  // as on the command line
  std::optional<double> tolerance;
  std::optional<int> freeze_count, group_bodies;
  bool paper = false;

  std::string report;                  // file, "-" for the standard output, empty for none
  std::string frames_csv;              // file or empty
  std::string trace;                   // file or empty
  std::string probes;                  // file or empty
  std::string picture;                 // file or empty
  std::string record;                  // file or empty
  std::optional<double> picture_time;  // [s] of simulated time; neither this nor the next: at the end
  std::optional<int> picture_frame;    // after so many frames

  std::string html;         // file or empty: a page that shows the run
  bool html_plays = false;  // it opens at the beginning, not at the worst frame
  bool live = false;        // no file: a page is served while the scene runs
  int port = 0;             // at which; 0: any that is free

  bool strict = false;  // a failed step is an exit status of its own

  std::string export_fclib;        // folder for the island problems, or empty
  std::vector<int> export_frames;  // from 1; empty: all

  std::vector<std::string> arguments;  // what decides the run of all this, see RunArguments()

  bool ReportOnStdout() const { return report == "-"; }
};

// The files that it writes, each with the option that asks for it.
std::vector<std::pair<const char*, std::string>> Outputs(const RunOptions& options);

bool IsPng(const std::string& picture);  // else it is SVG

void AddRunOptions(CLI::App* command, RunOptions* options);

// Of `islet view`: those that choose scene, time and method, and where the page goes or that it is live.
void AddViewOptions(CLI::App* command, RunOptions* options);
// Those that were given of what decides the run, in a form that ParseRunArguments reads: neither outputs nor threads.
std::vector<std::string> RunArguments(const CLI::App& command);

// errors: also an argument that does not decide the run
RunOptions ParseRunArguments(const std::vector<std::string>& arguments);
// Those of them that make the scene, whose ranges BuildScene checks; and the built-in scene of a name, or an error that lists them.
void AddSceneParameters(CLI::App* command, SceneParameters* parameters);
const Scene& RequireScene(const std::string& name);

// Values in range, files writable. Changes no file.
void CheckRunOptions(const RunOptions& options);

// What is not asked for stays as the scene has it. The threads are counted here, so that the report can tell how many there were.
Settings MakeSettings(const RunOptions& options, const Settings& of_scene = {});

const char* NameOf(Model model);
const char* NameOf(Cone cone);
const char* NameOf(BounceLaw law);
const char* NameOf(Freezing freezing);

}  // namespace islet
