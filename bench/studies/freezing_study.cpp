// Freezing: what it saves and what it costs in exactness; Table 1 and Fig. 6 of the paper.                          [SM04]
//
//   study_freezing --out freezing.csv --frames-out frames.csv [--scene cubejam ...] [--quick] [--budget 300]
//
// Two phases, each without freezing and with it, one thread, 1/30 s:
//   run    the whole scene, as long as the paper's. Deviation: from the run without freezing, at the end. These scenes are
//          chaotic, so the kind "nudged" (no freezing, one body starts 1e-9 m aside) tells what deviation means nothing
//   rest   from the state in which the run without freezing ends, 10 s more (cubeglass 3 s). Deviation: from its continuation
//          without freezing; in the row of `off` itself, how far that went
//
// Settings: `default` the engine's; `as_paper` kinetic model, octagon, no priority queue (the paper left out step 1 for Table 1),
// and no ladder: the paper solves each problem whole.
// Kinds: off, nudged, certified (knob: freeze_seconds; freeze_travel in proportion), paper (knob: c_f).
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/studies/study_csv.h"
#include "scenes/scene.h"

namespace islet::studies {
namespace {

constexpr double kFrame = 1.0 / 30;  // [s]
constexpr double kNudge = 1e-9;      // [m]
constexpr int kNoKnob = -1;

struct Options {
  std::string out, frames_out;
  std::vector<std::string> scenes{"stack", "csstack", "cubejam", "cubeglass"};
  bool quick = false;
  double budget = 300;  // [s]
};

struct StudyScene {
  const char* name;
  SceneParameters parameters;
  int frames;        // as many as the paper had collision QPs without freezing; cubeglass: it has settled
  int freeze_count;  // c_f of the paper; 1 where it names none
  bool sweep;        // other knobs than the default as well
  bool as_paper;
  int repeats;
  int rest_frames;
};
const StudyScene kScenes[] = {
    {"stack", {.drop = 0.3}, 489, 1, true, true, 5, 300},
    {"csstack", {}, 478, 1, true, true, 5, 300},
    {"cubejam", {}, 822, 3, true, true, 2, 300},
    {"cubeglass", {}, 450, 3, false, false, 1, 100},
};

struct Kind {
  std::string name;
  Freezing freezing = Freezing::kOff;
  double knob = kNoKnob;
};

std::vector<Kind> KindsOf(const StudyScene& scene, bool as_paper, bool quick) {
  std::vector<Kind> kinds{{"off"}};
  if (scene.sweep) kinds.push_back({"nudged"});
  const Settings standard;
  kinds.push_back({"certified", Freezing::kCertified, standard.freeze_seconds});
  kinds.push_back({"paper", Freezing::kPaper, static_cast<double>(scene.freeze_count)});
  if (quick || !scene.sweep) return kinds;
  if (!as_paper)  // slow, and of no use to whoever wants the paper's settings
    for (const double seconds : {0.034, 0.3, 1.0}) kinds.push_back({"certified", Freezing::kCertified, seconds});
  for (const int count : {1, 3, 10, 30})
    if (count != scene.freeze_count) kinds.push_back({"paper", Freezing::kPaper, static_cast<double>(count)});
  return kinds;
}

// Whether the run belongs into Fig. 6: not one of the other knobs.
bool IsStandard(const Kind& kind, const StudyScene& scene) {
  if (kind.freezing == Freezing::kPaper) return kind.knob == scene.freeze_count;
  return kind.freezing == Freezing::kOff || kind.knob == Settings{}.freeze_seconds;
}

Settings MakeSettings(const Kind& kind, bool as_paper) {
  Settings settings = as_paper ? Settings::Paper() : Settings{};
  if (as_paper) settings.bounce_limit = 0, settings.ladder = qp::Ladder::Off();
  settings.threads = 1;
  settings.freezing = kind.freezing;
  if (kind.freezing == Freezing::kPaper) settings.freeze_count = static_cast<int>(kind.knob);
  if (kind.freezing == Freezing::kCertified) {
    settings.freeze_travel *= kind.knob / settings.freeze_seconds;
    settings.freeze_seconds = kind.knob;
  }
  return settings;
}

using Poses = std::vector<Vector3>;  // [m] centres of the moving bodies

Poses PosesOf(const World& world) {
  Poses poses;
  for (const Body& body : world.bodies())
    if (body.kind == BodyKind::kDynamic) poses.push_back(body.position_W);
  return poses;
}

struct Deviation {  // [m]
  double rms = 0, most = 0;
};

Deviation Between(const Poses& a, const Poses& b) {
  Deviation d;
  for (size_t i = 0; i < a.size(); ++i) {
    const double distance = (a[i] - b[i]).norm();
    d.rms += distance * distance;
    d.most = std::max(d.most, distance);
  }
  d.rms = std::sqrt(d.rms / static_cast<double>(std::max<size_t>(1, a.size())));
  return d;
}

struct Qp {
  double seconds = 0;
  int frames = 0, problems = 0, failed = 0;  // frames in which there was one: the paper's "QPs solved"

  void Add(const QpSummary& summary, double least) {
    seconds += least;
    frames += summary.solved > 0;
    problems += summary.solved, failed += summary.failed;
  }
};

struct Total {
  int frames = 0;
  Qp collision, resting;
  double step = 0, freeze = 0, contacts = 0, awake = 0;
  int awake_at_end = 0;
  double penetration = 0;  // [m] deepest of all steps
  std::uint64_t hash = 0;
};

struct FrameTime {  // [s]
  double collision = INFINITY, resting = INFINITY, freeze = INFINITY, step = INFINITY;
  int contacts = 0, awake = 0;
};

class Study {
 public:
  explicit Study(const Options& options)
      : options_(options),
        csv_(options.out, {},
             "phase,scene,settings,kind,knob,frames,collision_s,collision_frames,collision_problems,static_s,static_"
             "frames,"
             "static_problems,failed,step_s,freeze_s,contacts_mean,awake_mean,awake_end,deviation_rms,deviation_max,"
             "penetration_max,state_hash"),
        frames_(options.frames_out, {}, "scene,settings,kind,knob,frame,contacts,collision_s,static_s,step_s,awake") {}

  void Run() {
    for (const StudyScene& scene : kScenes) {
      if (std::find(options_.scenes.begin(), options_.scenes.end(), scene.name) == options_.scenes.end()) continue;
      for (const bool as_paper : {false, true}) {
        if (as_paper && !scene.as_paper) continue;
        if (clock_.Wall() > options_.budget) {
          Say(std::string("  freezing: no time was left for ") + scene.name);
        } else {
          RunScene(scene, as_paper);
        }
      }
    }
  }

 private:
  void RunScene(const StudyScene& scene, bool as_paper) {
    const char* settings_name = as_paper ? "as_paper" : "default";
    const std::vector<Kind> kinds = KindsOf(scene, as_paper, options_.quick);
    std::optional<WorldSnapshot> settled;
    Poses reference;
    for (const Kind& kind : kinds) {
      World world = BuildScene(*FindScene(scene.name), scene.parameters, MakeSettings(kind, as_paper)).world;
      if (kind.name == "nudged") Nudge(&world);
      const bool record = std::string(scene.name) == "cubejam" && IsStandard(kind, scene);
      const Total total = Frames(scene, settings_name, kind, scene.frames, record, &world);
      if (kind.name == "off") settled = world.Save(), reference = PosesOf(world);
      Write("run", scene, settings_name, kind, total, Between(PosesOf(world), reference));
    }
    for (const Kind& kind : kinds) {
      if (kind.name == "nudged") continue;
      World world(MakeSettings(kind, as_paper));
      world.Restore(*settled);
      const Total total = Frames(scene, settings_name, kind, scene.rest_frames, false, &world);
      const Poses start = reference;
      if (kind.name == "off") reference = PosesOf(world);
      Write("rest", scene, settings_name, kind, total, Between(PosesOf(world), start));
    }
  }

  static void Nudge(World* world) {
    for (size_t i = 0; i < world->bodies().size(); ++i) {
      const Body& body = world->bodies()[i];
      if (body.kind != BodyKind::kDynamic) continue;
      world->Teleport(static_cast<int>(i), body.position_W + kNudge * Vector3::UnitX(), body.rotation_WB);
      return;
    }
  }

  // Runs are repeated and the same bit for bit, so of each frame the least time counts.
  Total Frames(const StudyScene& scene, const char* settings, const Kind& kind, int frames, bool record, World* world) {
    const WorldSnapshot start = world->Save();
    std::vector<FrameTime> least(static_cast<size_t>(frames));
    Total total;
    for (int repeat = 0; repeat < (options_.quick ? 1 : scene.repeats); ++repeat) {
      if (repeat > 0) world->Restore(start);
      const std::uint64_t hash = total.hash;
      total = RunAgain(&least, world);
      if (repeat > 0 && hash != total.hash)
        throw std::logic_error(std::string(scene.name) + ": two runs of the same scene differ");
    }
    for (int frame = 0; record && kind.name != "nudged" && frame < frames; ++frame) {
      const FrameTime& t = least[frame];
      frames_.Row(scene.name, settings, kind.name, kind.knob, frame + 1, t.contacts, t.collision, t.resting, t.step,
                  t.awake);
    }
    return total;
  }

  static Total RunAgain(std::vector<FrameTime>* least, World* world) {
    Total total;
    for (FrameTime& time : *least) {
      const StepReport report = world->Step(kFrame);
      time.collision = std::min(time.collision, report.collision_qp.seconds);
      time.resting = std::min(time.resting, report.static_qp.seconds);
      time.freeze = std::min(time.freeze, report.seconds.freeze);
      time.step = std::min(time.step, report.seconds.Total());
      time.contacts = report.active_contacts, time.awake = report.awake;
      total.collision.Add(report.collision_qp, time.collision), total.resting.Add(report.static_qp, time.resting);
      total.step += time.step, total.freeze += time.freeze;
      total.contacts += report.active_contacts, total.awake += report.awake;
      total.awake_at_end = report.awake;
      total.penetration = std::max(total.penetration, report.penetration_max);
    }
    total.frames = static_cast<int>(least->size()), total.hash = world->StateHash();
    return total;
  }

  void Write(const char* phase, const StudyScene& scene, const char* settings, const Kind& kind, const Total& t,
             const Deviation& d) {
    csv_.Row(phase, scene.name, settings, kind.name, kind.knob, t.frames, t.collision.seconds, t.collision.frames,
             t.collision.problems, t.resting.seconds, t.resting.frames, t.resting.problems,
             t.collision.failed + t.resting.failed, t.step, t.freeze, t.contacts / t.frames, t.awake / t.frames,
             t.awake_at_end, d.rms, d.most, t.penetration, Hex(t.hash));
    Say(std::string("  freezing: ") + phase + ' ' + scene.name + ' ' + settings + ' ' + kind.name + ' ' +
        std::to_string(kind.knob) + ": " + std::to_string(t.step) + " s, " +
        std::to_string(static_cast<int>(clock_.Wall())) + " of at most about " +
        std::to_string(static_cast<int>(options_.budget)) + " s");
  }

  const Options& options_;
  const StudyClock clock_;
  StudyCsv csv_, frames_;
};

}  // namespace
}  // namespace islet::studies

int main(int argc, char** argv) {
  islet::studies::Options options;
  CLI::App app("Freezing: what it saves and what it costs");
  app.add_option("--out", options.out, "CSV file of the runs")->required();
  app.add_option("--frames-out", options.frames_out, "CSV file of the frames of cubejam")->required();
  app.add_option("--scene", options.scenes, "stack, csstack, cubejam, cubeglass (all)")
      ->check(CLI::IsMember({"stack", "csstack", "cubejam", "cubeglass"}));
  app.add_flag("--quick", options.quick, "the default knobs alone");
  app.add_option("--budget", options.budget, "[s] no new scene is begun after that");
  return islet::studies::RunStudy(&app, argc, argv, [&] { islet::studies::Study(options).Run(); });
}
