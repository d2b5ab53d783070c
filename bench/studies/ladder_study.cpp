// The ladder (qp/ladder.h): error against time with and without it, and which rung answers how much of each scene.
//
//   study_ladder --out ladder.csv [--scene stack ...] [--quick] [--budget 170]
//
// Every scene is run from one state with each tolerance, `--ladder auto` and `off` in turn, one thread, 1/30 s; runs are repeated
// (each second time in the other order) and the same bit for bit, so of each frame the least time counts. In scenes with a lead
// the state is that after so many frames of normal effort.
//   map        [m/s] natural map of exact Coulomb, rms over the contacts, of the worst island of each frame, by engine/certificate
//   deviation  [m] farthest body from the run with `nothing`, `sweeps` and what motion has at 1e-10, at the end. These scenes may be
//              chaotic: in the row `nudged` (as that run, one body 1e-9 m aside) stands what deviation means nothing
// Two runs of a chaotic scene do not solve the same problems. So there is a third pair at 1e-6, `stepwise auto` and `off`: both
// begin each frame in the state that the latter left; their deviation is the largest of any one frame.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "bench/studies/study_csv.h"
#include "scenes/scene.h"

namespace islet::studies {
namespace {

constexpr double kFrame = 1.0 / 30;   // [s]
constexpr double kReference = 1e-10;  // tolerance
constexpr double kNudge = 1e-9;       // [m]
constexpr double kEnough = 1.5;       // [s] after which a pair is not repeated again
constexpr int kMost = 9;              // repeats of a pair
constexpr double kTolerances[] = {1e-6, 1e-3, 1e-8, 1e-5, 1e-4, 1e-7};

struct Options {
  std::string out;
  std::vector<std::string> scenes;
  bool quick = false;
  double budget = 170;  // [s]
};

struct StudyScene {
  const char* name;
  const char* scene;
  SceneParameters parameters;
  Freezing freezing;
  int lead, frames;
};
const StudyScene kScenes[] = {
    {"stack", "stack", {.drop = 0.3}, Freezing::kCertified, 0, 150},
    {"stack (not frozen)", "stack", {}, Freezing::kOff, 0, 100},
    {"csstack", "csstack", {}, Freezing::kCertified, 0, 120},
    {"officetoy", "officetoy", {}, Freezing::kCertified, 0, 300},
    {"balance", "balance", {}, Freezing::kCertified, 0, 150},
    {"revival", "revival", {}, Freezing::kCertified, 0, 60},
    {"manystacks", "manystacks", {.drop = 0.3}, Freezing::kCertified, 0, 60},
    {"manystacks (not frozen)", "manystacks", {}, Freezing::kOff, 0, 60},
    {"sphereglass", "sphereglass", {}, Freezing::kCertified, 0, 130},
    {"cubejam (not frozen)", "cubejam", {}, Freezing::kOff, 0, 150},
    {"cubeglass", "cubeglass", {}, Freezing::kCertified, 90, 12},
    {"cubeglass7", "cubeglass7", {}, Freezing::kCertified, 90, 8},
};

struct Kind {
  const char* name;  // ends with "auto": with the ladder
  double tolerance;
};

Settings MakeSettings(const StudyScene& scene, const Kind& kind) {
  Settings settings;
  settings.threads = 1;
  settings.freezing = scene.freezing;
  settings.tolerance = kind.tolerance;
  const std::string_view name = kind.name;
  if (!name.ends_with("auto")) settings.ladder = qp::Ladder::Off();
  if (name == "reference" || name == "nudged")
    for (const qp::Rung rung : {qp::Rung::kNothing, qp::Rung::kSweeps, qp::Rung::kKeptPairs, qp::Rung::kReach})
      settings.ladder = settings.ladder.With(rung);
  return settings;
}

struct Run {
  std::vector<double> wall, cpu;  // [s] of each frame
  double qp = 0;                  // [s]
  LadderReport ladder, motion_ladder;
  double map_mean = 0, map_max = 0, penetration = 0, contacts = 0, energy = 0;
  int failed = 0, missed = 0, frozen = 0;
  double deviation = 0;          // [m]
  std::vector<Vector3> centres;  // [m] of all bodies at the end
  std::uint64_t hash = 0;

  double Cpu() const { return Sum(cpu); }
  double Wall() const { return Sum(wall); }
  static double Sum(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value;
    return sum;
  }

  void Add(const StepReport& report) {
    qp += report.collision_qp.seconds + report.static_qp.seconds;
    ladder.Include(report.ladder);
    motion_ladder.Include(report.motion_ladder);
    map_mean += report.certificate.coulomb_map_rms;  // a sum until the end
    map_max = std::max(map_max, report.certificate.coulomb_map_rms);
    penetration = std::max(penetration, report.penetration_max);
    contacts += report.active_contacts;
    energy = report.kinetic_energy, frozen = report.frozen;
    for (const QpSummary& summary : {report.collision_qp, report.static_qp})
      failed += summary.failed, missed += summary.missed;
  }

  // A repeat: the least time of each frame, all else of the faster run.
  void Include(const Run& other) {
    if (hash != other.hash) throw std::logic_error("two runs of the same scene differ");
    std::vector<double> least_wall = wall, least_cpu = cpu;
    for (size_t i = 0; i < wall.size(); ++i) {
      least_wall[i] = std::min(wall[i], other.wall[i]);
      least_cpu[i] = std::min(cpu[i], other.cpu[i]);
    }
    if (other.qp < qp) *this = other;
    wall = least_wall, cpu = least_cpu;
  }
};

WorldSnapshot Lead(const StudyScene& scene) {
  Settings settings = MakeSettings(scene, {"auto", 1e-6});
  World world = BuildScene(*FindScene(scene.scene), scene.parameters, settings).world;
  for (int frame = 0; frame < scene.lead; ++frame) world.Step(kFrame);
  return world.Save();
}

double Deviation(const Run& a, const Run& b) {
  double most = 0;
  for (size_t i = 0; i < a.centres.size(); ++i) most = std::max(most, (a.centres[i] - b.centres[i]).norm());
  return most;
}

void Step(World* world, Run* run) {
  const StudyClock clock;
  const StepReport report = world->Step(kFrame);
  run->cpu.push_back(clock.Cpu()), run->wall.push_back(clock.Wall());
  run->Add(report);
}

void Finish(const World& world, Run* run) {
  run->map_mean /= static_cast<double>(run->cpu.size()), run->contacts /= static_cast<double>(run->cpu.size());
  run->hash = world.StateHash();
}

void KeepCentres(const World& world, Run* run) {
  run->centres.clear();
  for (const Body& body : world.bodies()) run->centres.push_back(body.position_W);
}

// reference: null if this is it.
Run RunOnce(const StudyScene& scene, const WorldSnapshot& start, const Kind& kind, const Run* reference) {
  World world(MakeSettings(scene, kind));
  world.Restore(start);
  if (std::string(kind.name) == "nudged") {
    const auto moves = [](const Body& b) { return b.kind == BodyKind::kDynamic; };
    const int first = static_cast<int>(std::ranges::find_if(world.bodies(), moves) - world.bodies().begin());
    const Body& body = world.body(first);
    world.Teleport(first, body.position_W + kNudge * Vector3::UnitX(), body.rotation_WB);
  }
  Run run;
  for (int frame = 0; frame < scene.frames; ++frame) Step(&world, &run);
  Finish(world, &run);
  KeepCentres(world, &run);
  if (reference != nullptr) run.deviation = Deviation(run, *reference);
  return run;
}

std::array<Run, 2> RunStepwise(const StudyScene& scene, WorldSnapshot state, const Kind (&kinds)[2]) {
  std::array<World, 2> worlds{World(MakeSettings(scene, kinds[0])), World(MakeSettings(scene, kinds[1]))};
  std::array<Run, 2> runs;
  double most = 0;
  for (int frame = 0; frame < scene.frames; ++frame) {
    for (const int k : {frame % 2, 1 - frame % 2}) {
      worlds[k].Restore(state);
      Step(&worlds[k], &runs[k]);
      KeepCentres(worlds[k], &runs[k]);
    }
    most = std::max(most, Deviation(runs[0], runs[1]));
    state = worlds[1].Save();
  }
  for (const int k : {0, 1}) Finish(worlds[k], &runs[k]), runs[k].deviation = most;
  return runs;
}

class Study {
 public:
  explicit Study(const Options& options) : options_(options), csv_(options.out, {}, Columns()) {}

  void RunAll() {
    std::vector<Case> cases;
    for (const StudyScene& scene : kScenes) {
      const auto& asked = options_.scenes;
      if (!asked.empty() && std::count(asked.begin(), asked.end(), scene.scene) == 0) continue;
      const Kind kind{"reference", kReference};
      WorldSnapshot start = Lead(scene);
      Run reference = RunOnce(scene, start, kind, nullptr);
      cases.push_back({&scene, std::move(start), std::move(reference)});
      Write(cases.back(), kind, cases.back().reference, 1);
    }
    for (const double tolerance : kTolerances) {  // of all scenes before the next one: time may run out
      if (options_.quick && tolerance != 1e-3 && tolerance != 1e-6) continue;
      for (const Case& one : cases) {
        if (clock_.Cpu() > options_.budget) {
          std::ostringstream line;
          line << "  ladder: no time was left for " << one.scene->name << ' ' << tolerance;
          Say(line.str());
        } else {
          RunPair(one, tolerance);
        }
      }
    }
  }

 private:
  struct Case {
    const StudyScene* scene;
    WorldSnapshot start;
    Run reference;
  };

  static std::string Columns() {
    std::string columns =
        "scene,frames,lead,ladder,tolerance,repeats,cpu_s,wall_s,qp_s,map_mean,map_max,deviation,"
        "energy_end,penetration_max,contacts_mean,frozen_end,failed,missed,";
    for (int rung = 0; rung < qp::kNumProblemRungs; ++rung)
      columns += qp::kRungNames[rung] + std::string("_n,") + qp::kRungNames[rung] + "_s,";
    return columns + "kept_pairs,spared_detections,state_hash";
  }

  void RunPair(const Case& one, double tolerance) {
    const Kind kinds[] = {{"auto", tolerance}, {"off", tolerance}};
    const bool asked = tolerance == kTolerances[0];
    const auto run = [&](int k) { return RunOnce(*one.scene, one.start, kinds[k], &one.reference); };
    Repeat(one, kinds, asked ? 2 : 1, [&](int repeat) {
      const int first = repeat % 2;  // in turn
      std::array<Run, 2> runs;
      for (const int k : {first, 1 - first}) runs[k] = run(k);
      return runs;
    });
    if (!asked) return;
    const Kind stepwise[] = {{"stepwise auto", tolerance}, {"stepwise off", tolerance}};
    Repeat(one, stepwise, 1, [&](int) { return RunStepwise(*one.scene, one.start, stepwise); });
    if (options_.quick) return;
    const Kind nudged{"nudged", kReference};
    Write(one, nudged, RunOnce(*one.scene, one.start, nudged, &one.reference), 1);
  }

  template <typename Pair>
  void Repeat(const Case& one, const Kind (&kinds)[2], int least, const Pair& pair) {
    const StudyClock clock;
    std::array<Run, 2> runs = pair(0);
    int repeats = 1;
    for (; !options_.quick && (repeats < least || (repeats < kMost && clock.Cpu() < kEnough)); ++repeats) {
      const std::array<Run, 2> again = pair(repeats);
      for (const int k : {0, 1}) runs[k].Include(again[k]);
    }
    for (const int k : {0, 1}) Write(one, kinds[k], runs[k], repeats);
  }

  void Write(const Case& one, const Kind& kind, const Run& run, int repeats) {
    const StudyScene& scene = *one.scene;
    std::ostringstream rungs;
    for (int r = 0; r < qp::kNumProblemRungs; ++r) {
      rungs << run.ladder.rungs[r].problems << ',' << run.ladder.rungs[r].seconds << ',';
    }
    for (const qp::Rung rung : {qp::Rung::kKeptPairs, qp::Rung::kReach})
      rungs << run.motion_ladder.rungs[static_cast<int>(rung)].problems << ',';
    csv_.Row(scene.name, scene.frames, scene.lead, kind.name, kind.tolerance, repeats, run.Cpu(), run.Wall(), run.qp,
             run.map_mean, run.map_max, run.deviation, run.energy, run.penetration, run.contacts, run.frozen,
             run.failed, run.missed, rungs.str() + Hex(run.hash));
    std::ostringstream line;
    line << "  ladder: " << scene.name << ' ' << kind.name << ' ' << kind.tolerance << ": " << run.Cpu() << " s, "
         << static_cast<int>(clock_.Cpu()) << " of at most about " << options_.budget << " s";
    Say(line.str());
  }

  const Options& options_;
  const StudyClock clock_;
  StudyCsv csv_;
};

}  // namespace
}  // namespace islet::studies

int main(int argc, char** argv) {
  islet::studies::Options options;
  CLI::App app("Error against time with the ladder and without");
  app.add_option("--out", options.out, "CSV file")->required();
  std::set<std::string> scenes;
  for (const auto& scene : islet::studies::kScenes) scenes.insert(scene.scene);
  app.add_option("--scene", options.scenes, "all that have one of these names (all)")->check(CLI::IsMember(scenes));
  app.add_flag("--quick", options.quick, "two tolerances, no repeats");
  app.add_option("--budget", options.budget, "[s] of the processor; no new pair is begun after that");
  return islet::studies::RunStudy(&app, argc, argv, [&] { islet::studies::Study(options).RunAll(); });
}
