#include "scenes/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <optional>
#include <stdexcept>

#include "engine/stopwatch.h"
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

// Tells when nothing moves any more. What moves by a velocity of its own never comes to rest.
class RestWatch {
 public:
  explicit RestWatch(const Settings& settings)
      : freezing_(settings.freezing != Freezing::kOff && !settings.stateless) {}

  bool AtRest(const World& world, const StepReport& report, double dt) {
    for (const Body& body : world.bodies()) {
      if (body.kind == BodyKind::kKinematic && !body.removed &&
          !(body.linear_velocity_W.isZero(0) && body.angular_velocity_W.isZero(0)))
        return false;
    }
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

// One output that fails does not cost the others: what went wrong is kept, and told when all is done.
class Failures {
 public:
  template <typename Write>
  void Try(const Write& write) {
    try {
      write();
    } catch (const std::exception& error) {
      lines_.append(lines_.empty() ? "" : "\n").append(error.what());
    }
  }

  // errors: std::runtime_error with a line for each
  void Tell() const {
    if (!lines_.empty()) throw std::runtime_error(lines_);
  }

 private:
  std::string lines_;
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

RunEnd RunScene(const RunOptions& options, const RunWatch& watch) {
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
  bool drawn = false;
  Failures failures;
  const auto draw = [&](const World& seen) {
    drawn = true;
    failures.Try([&] { drawing = IsPng(options.picture) ? Png(picture.Draw(seen)) : Svg(picture.Draw(seen)); });
  };
  const auto is_time_to_draw = [&](int frames_done) {
    if (options.picture_frame) return frames_done >= *options.picture_frame;
    return frames_done * dt >= picture_time - 1e-9;
  };

  std::optional<FclibExport> problems;
  bool exported = true;  // all so far
  if (!options.export_fclib.empty()) {
    const Settings& s = world.settings();
    problems.emplace(options.export_fclib, options.export_frames,
                     fmt::format("{} seed {}, dt {} s, model {}, cone {}, tolerance {}", scene.name, info.seed, dt,
                                 NameOf(s.model), NameOf(s.cone), s.tolerance));
  }

  std::optional<Recorder> recorder;
  if (!options.record.empty()) recorder.emplace(options, scene);
  if (watch && !watch(world, 0)) return {"watch"};
  std::optional<RunPage> page;
  const double start_energy = PotentialEnergy(world);
  if (!options.html.empty()) {
    page.emplace(options.html, RunHead(options, scene),
                 PageOptions{options.html_plays ? PageStart::kBeginning : PageStart::kWorstFrame,
                             1 + std::min(frame_limit, std::numeric_limits<int>::max() - 1)});
    page->Add(FrameOf(world, {}, 0, 0, start_energy));
  }

  const char* stopped_by = options.frames ? "frames" : options.seconds ? "seconds" : "time limit";
  if (scene.probes) scene.probes->Add(world, 0, dt);
  const double start = Seconds();
  int frames_done = 0;
  for (int frame = 1; frame <= frame_limit; ++frame) {
    if (Interrupt::Asked()) {
      progress.End();
      stopped_by = "interrupt";
      break;
    }
    if (!drawn && !options.picture.empty() && is_time_to_draw(frame - 1)) draw(world);
    const bool observed = problems && problems->Wants(frame);
    if (observed) {
      world.SetProblemObserver([&](const ProblemRecord& record) {
        if (exported) failures.Try([&] { exported = false, problems->Write(frame, record), exported = true; });
      });
    }
    if (scene.drive) scene.drive((frame - 1) * dt, &world);
    const double step_start = Seconds();
    const StepReport report = world.Step(dt);
    const double step_seconds = Seconds() - step_start;
    if (!options.trace.empty()) trace.AddFrame(frame, step_start, step_start + step_seconds);
    if (observed) world.SetProblemObserver({});
    frames_done = frame;

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
  if (watch) return {stopped_by};
  run_report.Finish(world, Seconds() - start, stopped_by);

  std::FILE* const people = options.ReportOnStdout() ? stderr : stdout;
  const auto write = [&](const std::string& file, const auto& text) {
    if (!file.empty()) failures.Try([&] { WriteWhole(file, text()); });
  };
  if (!options.picture.empty() && !drawn) {
    if (!is_time_to_draw(frames_done) && (options.picture_frame || options.picture_time))
      Print(stderr,
            fmt::format("islet: the run ended with frame {}, before --picture-{}; {} shows its end\n", frames_done,
                        options.picture_frame ? fmt::format("frame {}", *options.picture_frame)
                                              : fmt::format("time {}", *options.picture_time),
                        options.picture));
    draw(world);
  }
  if (!drawing.empty()) write(options.picture, [&] { return drawing; });
  write(options.trace, [&] { return trace.Json(); });
  write(options.frames_csv, [&] { return frame_log.text(); });
  if (scene.probes) write(options.probes, [&] { return scene.probes->text(); });
  if (!options.ReportOnStdout()) write(options.report, [&] { return run_report.Json(); });
  Print(people, run_report.Summary());
  if (problems) Print(people, problems->Told());
  if (options.ReportOnStdout()) Print(stdout, run_report.Json());
  if (page) failures.Try([&] { Print(people, page->Finish(stopped_by)); });
  if (recorder) failures.Try([&] { recorder->Finish(stopped_by); });
  if (const std::string warning = run_report.Warning(); !warning.empty())
    Print(stderr, fmt::format("islet: warning: {}\n", warning));
  failures.Tell();
  return {stopped_by, run_report.failed_steps()};
}

}  // namespace islet
