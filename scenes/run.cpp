#include "scenes/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <optional>
#include <stdexcept>

#include "scenes/drawing_png.h"
#include "scenes/export_fclib.h"
#include "scenes/frame_log.h"
#include "scenes/interrupt.h"
#include "scenes/output_file.h"
#include "scenes/picture.h"
#include "scenes/progress.h"
#include "scenes/ready_scene.h"
#include "scenes/recorder.h"
#include "scenes/run_page.h"
#include "scenes/run_report.h"
#include "scenes/trace.h"

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

bool IsPng(const std::string& file) {
  std::string end = file.substr(file.size() - std::min<size_t>(file.size(), 4));
  std::transform(end.begin(), end.end(), end.begin(), [](unsigned char c) { return std::tolower(c); });
  return end == ".png";
}

int FrameLimit(const RunOptions& options, const ReadyScene& scene) {
  if (options.frames) return *options.frames;
  const double frames = std::ceil(options.seconds.value_or(scene.time_limit) / scene.dt - 1e-9);
  if (frames > std::numeric_limits<int>::max()) {
    throw std::invalid_argument(fmt::format("--dt {} makes {:.0f} frames, which is too many", scene.dt, frames));
  }
  return std::max(1, static_cast<int>(frames));
}

}  // namespace

std::string RunScene(const RunOptions& options, const RunWatch& watch) {
  CheckRunOptions(options);
  ReadyScene scene = MakeReady(options);
  World& world = scene.world;
  const SceneInfo& info = scene.info;
  const double dt = scene.dt;
  const int frame_limit = FrameLimit(options, scene);
  const Interrupt interrupt("ends after the frame under way");
  Trace trace;
  if (!options.trace.empty()) trace.Begin();

  RunReport run_report(scene.name, scene.expected, info, world, dt);
  FrameLog frame_log;
  RestWatch rest(world.settings());
  const Picture picture(world, info);
  const bool until_rest = scene.stop_at_rest && !options.frames && !options.seconds;
  Progress progress(frame_limit, dt, until_rest);
  const double picture_time = options.picture_time.value_or(std::numeric_limits<double>::infinity());
  std::string drawing;
  const auto draw = [&](const World& seen) {
    return IsPng(options.picture) ? Png(picture.Draw(seen)) : Svg(picture.Draw(seen));
  };
  const auto is_time_to_draw = [&](int frames_done) {
    if (options.picture_frame) return frames_done >= *options.picture_frame;
    return frames_done * dt >= picture_time - 1e-9;
  };

  std::optional<FclibExport> problems;
  if (!options.export_fclib.empty()) {
    const Settings& s = world.settings();
    problems.emplace(options.export_fclib, options.export_frames,
                     fmt::format("{} seed {}, dt {} s, model {}, cone {}, tolerance {}", scene.name, info.seed, dt,
                                 NameOf(s.model), NameOf(s.cone), s.tolerance));
  }

  std::optional<Recorder> recorder;
  if (!options.record.empty()) recorder.emplace(options, scene);
  if (watch && !watch(world, 0)) return "watch";
  std::optional<RunPage> page;
  const double start_energy = PotentialEnergy(world);
  if (!options.html.empty()) {
    page.emplace(options.html, RunHead(options, scene),
                 PageOptions{options.html_plays ? PageStart::kBeginning : PageStart::kWorstFrame, frame_limit + 1});
    page->Add(FrameOf(world, {}, 0, 0, start_energy));
  }

  const char* stopped_by = options.frames ? "frames" : options.seconds ? "seconds" : "time limit";
  if (scene.probes) scene.probes->Add(world, 0, dt);
  const double start = WallTime();
  for (int frame = 1; frame <= frame_limit; ++frame) {
    if (Interrupt::Asked()) {
      progress.End();
      stopped_by = "interrupt";
      break;
    }
    if (drawing.empty() && !options.picture.empty() && is_time_to_draw(frame - 1)) drawing = draw(world);
    if (problems && problems->Wants(frame)) {
      world.SetProblemObserver([&](const ProblemRecord& record) { problems->Write(frame, record); });
    }
    if (scene.drive) scene.drive((frame - 1) * dt, &world);
    const double step_start = WallTime();
    const StepReport report = world.Step(dt);
    const double step_seconds = WallTime() - step_start;
    if (!options.trace.empty()) trace.AddFrame(frame, step_start, step_start + step_seconds);
    world.SetProblemObserver({});

    run_report.AddFrame(report, step_seconds, world);
    if (!options.frames_csv.empty()) frame_log.Add(report, step_seconds);
    if (scene.probes) scene.probes->Add(world, frame, dt);
    if (recorder) recorder->Add(world, report, frame, step_seconds);
    if (page) page->Add(FrameOf(world, report, frame, step_seconds, start_energy));
    const bool at_rest = until_rest && rest.AtRest(world, report, dt);
    if (at_rest) stopped_by = "rest";
    const bool seen = watch && !watch(world, frame);
    if (seen) stopped_by = "watch";
    if (at_rest || seen || frame == frame_limit) {
      progress.Finish(frame, step_seconds, report);
      break;
    }
    progress.Update(frame, step_seconds, report);
  }
  if (watch) return stopped_by;
  run_report.Finish(world, WallTime() - start, stopped_by);

  if (!options.picture.empty()) WriteWhole(options.picture, drawing.empty() ? draw(world) : drawing);
  if (!options.trace.empty()) WriteWhole(options.trace, trace.Json());
  if (!options.frames_csv.empty()) WriteWhole(options.frames_csv, frame_log.text());
  if (scene.probes) WriteWhole(options.probes, scene.probes->text());
  if (!options.report.empty() && !options.ReportOnStdout()) WriteWhole(options.report, run_report.Json());
  Print(options.ReportOnStdout() ? stderr : stdout, run_report.Summary());
  if (options.ReportOnStdout()) Print(stdout, run_report.Json());
  std::exception_ptr no_page;  // one output that fails does not cost the others
  try {
    if (page) Print(options.ReportOnStdout() ? stderr : stdout, page->Finish(stopped_by));
  } catch (const std::exception&) {
    no_page = std::current_exception();
  }
  if (recorder) recorder->Finish(stopped_by);
  if (no_page) std::rethrow_exception(no_page);
  return stopped_by;
}

}  // namespace islet
