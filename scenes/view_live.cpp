#include "scenes/view_live.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <utility>

#include "scenes/interrupt.h"
#include "scenes/live/command.h"
#include "scenes/live/live_run.h"
#include "scenes/live/live_server.h"
#include "scenes/output_file.h"
#include "scenes/ready_scene.h"
#include "scenes/recorder.h"
#include "scenes/viewer/live_page.h"
#include "scenes/viewer/page_chunk.h"

namespace islet {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr Seconds kShown(1.0 / 60);   // between two frames that are shown
constexpr Seconds kLongestWait(0.1);  // for messages: so late an interrupt is obeyed

class LiveView {
 public:
  LiveView(const RunOptions& options, ReadyScene scene)
      : head_(RunHead(options, scene)),
        position_step_(PositionStep(head_)),
        start_energy_(PotentialEnergy(scene.world)),
        run_(std::move(scene.world), scene.dt, std::move(scene.drive)),
        server_(LivePage(), options.port) {
    ShowHead();
    ShowState();
    ShowFrame();
  }

  const std::string& address() const { return server_.address(); }

  // Messages, then a step if it is time for one.
  void Turn() {
    const Seconds wait =
        run_.running() ? std::clamp<Seconds>(next_step_ - Clock::now(), Seconds(0), kLongestWait) : kLongestWait;
    server_.Serve(std::chrono::ceil<std::chrono::milliseconds>(wait),
                  [this](const LiveCommand& command) { Do(command); });
    if (changed_ || told_gravity_W_ != run_.world().settings().gravity) ShowState();
    if (generation_ != run_.generation()) ShowHead(), ShowFrame();
    const Clock::time_point now = Clock::now();
    if (run_.running() && now < next_step_) return;
    if (run_.Advance()) {
      step_seconds_ = Seconds(Clock::now() - now).count();
      next_step_ = std::max(next_step_ + std::chrono::duration_cast<Clock::duration>(Seconds(run_.dt())), now);
    }
    if (shown_ < run_.steps() && (!run_.running() || now >= next_frame_)) ShowFrame();
  }

 private:
  void Do(const LiveCommand& command) {
    run_.Do(command);
    changed_ = true;
  }

  void ShowHead() {
    const FilmHead now = HeadOf(run_.world(), run_.dt(), head_.scene, head_.command, head_.bounds);
    head_.shapes = now.shapes;
    head_.bodies = now.bodies;
    generation_ = run_.generation();
    server_.Show(LiveEvent::kHead, LiveHead(head_, position_step_));
  }

  void ShowState() {
    const Vector3& g = run_.world().settings().gravity;
    const std::string friction = run_.friction() ? fmt::format("{}", *run_.friction()) : "null";
    server_.Show(
        LiveEvent::kState,
        fmt::format(
            R"({{"running": {}, "gravity": [{}, {}, {}], "friction": {}, "changed": {}, "ball": {{"radius": [{}, {}], "density": [{}, {}]}}}})",
            run_.running(), g.x(), g.y(), g.z(), friction, run_.changed(), kSmallestBall, kLargestBall, kLightestBall,
            kHeaviestBall));
    told_gravity_W_ = g;
    changed_ = false;
  }

  void ShowFrame() {
    const FilmFrame frame = FrameOf(run_.world(), run_.report(), run_.steps(), step_seconds_, start_energy_);
    server_.Show(LiveEvent::kFrame, LiveFrame(head_, frame, position_step_));
    shown_ = run_.steps();
    next_frame_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(kShown);
  }

  FilmHead head_;
  double position_step_, start_energy_;
  Vector3 told_gravity_W_;  // which a scene may change, too
  LiveRun run_;
  LiveServer server_;
  bool changed_ = false;                          // what ShowState tells
  int generation_ = 0;                            // of the bodies that the page knows
  int shown_ = 0;                                 // steps
  double step_seconds_ = 0;                       // [s] wall, of the last step
  Clock::time_point next_step_{}, next_frame_{};  // not before
};

}  // namespace

void ViewLive(const RunOptions& options) {
  CheckRunOptions(options);
  const Interrupt interrupt("ends after the step under way");
  LiveView view(options, MakeReady(options));
  Print(stdout, fmt::format("page                {}\nOpen it in a browser. It runs until Ctrl-C.\n", view.address()));
  while (!Interrupt::Asked()) view.Turn();
}

}  // namespace islet
