#include "scenes/run.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <stdexcept>

#include "scenes/export_fclib.h"
#include "scenes/frame_log.h"
#include "scenes/output_file.h"
#include "scenes/picture.h"
#include "scenes/progress.h"
#include "scenes/ready_scene.h"
#include "scenes/run_report.h"

namespace islet {
namespace {

constexpr double kRestEnergy = 1e-8;  // [J/kg]
constexpr double kRestSeconds = 0.5;  // [s]

double WallTime() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Tells when nothing moves any more.
class RestWatch {
 public:
  explicit RestWatch(const Settings& settings) : freezing_(settings.freezing != Freezing::kOff) {}

  bool AtRest(const World& world, const StepReport& report, double dt) {
    if (freezing_) return report.awake == 0;
    double most = 0;  // [J/kg]
    for (const Body& body : world.bodies()) {
      if (body.kind == BodyKind::kDynamic) most = std::max(most, body.KineticEnergy() / body.mass);
    }
    calm_seconds_ = most < kRestEnergy ? calm_seconds_ + dt : 0;
    return calm_seconds_ >= kRestSeconds;
  }

 private:
  bool freezing_;
  double calm_seconds_ = 0;
};

int FrameLimit(const RunOptions& options, const ReadyScene& scene) {
  if (options.frames) return *options.frames;
  const double frames = std::ceil(options.seconds.value_or(scene.time_limit) / scene.dt - 1e-9);
  if (frames > std::numeric_limits<int>::max()) {
    throw std::invalid_argument(fmt::format("--dt {} makes {:.0f} frames, which is too many", scene.dt, frames));
  }
  return std::max(1, static_cast<int>(frames));
}

}  // namespace

void RunScene(const RunOptions& options) {
  CheckRunOptions(options);
  ReadyScene scene = MakeReady(options);
  World& world = scene.world;
  const SceneInfo& info = scene.info;
  const double dt = scene.dt;
  const int frame_limit = FrameLimit(options, scene);

  RunReport run_report(scene.name, scene.expected, info, world, dt);
  FrameLog frame_log;
  Progress progress(frame_limit * dt);
  RestWatch rest(world.settings());
  const Picture picture(world, info);
  const bool until_rest = scene.stop_at_rest && !options.frames && !options.seconds;
  const double picture_time = options.picture_time.value_or(std::numeric_limits<double>::infinity());
  std::string drawing;

  std::optional<FclibExport> problems;
  if (!options.export_fclib.empty()) {
    const Settings& s = world.settings();
    problems.emplace(options.export_fclib, options.export_frames,
                     fmt::format("{} seed {}, dt {} s, model {}, cone {}, tolerance {}", scene.name, info.seed, dt,
                                 NameOf(s.model), NameOf(s.cone), s.tolerance));
  }

  const char* stopped_by = options.frames ? "frames" : options.seconds ? "seconds" : "time limit";
  if (scene.probes) scene.probes->Add(world, 0, dt);
  const double start = WallTime();
  for (int frame = 1; frame <= frame_limit; ++frame) {
    if (drawing.empty() && !options.picture.empty() && (frame - 1) * dt >= picture_time - 1e-9) {
      drawing = picture.Draw(world);
    }
    if (problems && problems->Wants(frame)) {
      world.SetProblemObserver([&](const ProblemRecord& record) { problems->Write(frame, record); });
    }
    if (scene.drive) scene.drive((frame - 1) * dt, &world);
    const double step_start = WallTime();
    const StepReport report = world.Step(dt);
    const double step_seconds = WallTime() - step_start;
    world.SetProblemObserver({});

    run_report.AddFrame(report, step_seconds, world);
    if (!options.frames_csv.empty()) frame_log.Add(report, step_seconds);
    if (scene.probes) scene.probes->Add(world, frame, dt);
    const bool at_rest = until_rest && rest.AtRest(world, report, dt);
    if (at_rest) stopped_by = "rest";
    if (at_rest || frame == frame_limit) {
      progress.Finish(frame * dt, frame, step_seconds, report);
      break;
    }
    progress.Update(frame * dt, frame, step_seconds, report);
  }
  run_report.Finish(world, WallTime() - start, stopped_by);

  if (!options.picture.empty()) WriteWhole(options.picture, drawing.empty() ? picture.Draw(world) : drawing);
  if (!options.frames_csv.empty()) WriteWhole(options.frames_csv, frame_log.text());
  if (scene.probes) WriteWhole(options.probes, scene.probes->text());
  if (!options.report.empty() && !options.ReportOnStdout()) WriteWhole(options.report, run_report.Json());
  fmt::print(options.ReportOnStdout() ? stderr : stdout, "{}", run_report.Summary());
  if (options.ReportOnStdout()) fmt::print(stdout, "{}", run_report.Json());
  if (std::fflush(stdout) != 0) throw std::runtime_error("cannot write to the standard output");
}

}  // namespace islet
