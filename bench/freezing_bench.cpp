// What freezing saves: the time of the collision and of the static-contact QPs with and without it.     [SM04 Table 1]
//
//   build/bench/bench/bench_freezing                              every scene, setting and kind of freezing
//   build/bench/bench/bench_freezing --benchmark_filter=stack     some
//   build/bench/bench/bench_freezing --benchmark_format=json      for programs
//
// A row is a whole run of a scene, one thread, dt = 1/30 s, made a few times: the runs are the same bit for bit, so the
// least time of each frame is what it costs on a machine that does nothing else. What the columns mean:
// bench/README.md.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/settings.h"
#include "engine/step_report.h"
#include "scenes/scene.h"

namespace islet {
namespace {

struct BenchScene {
  const char* name;
  SceneParameters parameters;
  // At least as long as the paper's: one frame for each collision QP that it solved without freezing.
  int frames;
  int freeze_count;  // c_f of paper freezing
  int repeats;
};

// c_f is the paper's for the stack and the cubejam; it names none for the cubes and spheres.
const std::array<BenchScene, 3> kScenes{{
    {"stack", {.drop = 0.3}, 489, 1, 5},
    {"cubejam", {}, 822, 3, 2},
    {"csstack", {}, 478, 1, 5},
}};

enum class Method { kDefault, kPaper };
constexpr std::array<std::pair<Method, const char*>, 2> kMethods{
    {{Method::kPaper, "as_paper"}, {Method::kDefault, "default"}}};
constexpr std::array<std::pair<Freezing, const char*>, 3> kFreezings{
    {{Freezing::kOff, "off"}, {Freezing::kPaper, "paper"}, {Freezing::kCertified, "certified"}}};

// The paper measured without step 1: "the experiments to determine the speed-up from freezing always skip Step one".
Settings MakeSettings(Method method, Freezing freezing, int freeze_count) {
  Settings settings = method == Method::kPaper ? Settings::Paper() : Settings{};
  if (method == Method::kPaper) settings.bounce_limit = 0;
  settings.freezing = freezing;
  settings.freeze_count = freeze_count;
  settings.threads = 1;
  return settings;
}

// One of the two QPs over a run. In the paper a frame has one QP for all bodies, here one per island: its "QPs solved"
// are the frames in which any island had one.
struct QpTotal {
  double seconds = 0;
  int frames_with_qp = 0;
  int problems = 0;
  int failed = 0;

  double SecondsPerSolved() const { return frames_with_qp > 0 ? seconds / frames_with_qp : 0; }
};

struct RunTotal {
  int frames = 0;
  QpTotal collision, resting;
  double step_seconds = 0, freeze_seconds = 0;
  double active_contacts = 0, awake = 0;  // sums over the frames
  int awake_at_end = 0;
  std::uint64_t hash = 0;
};

// Counts from the report, times from `seconds` (per frame the least so far).
void Add(const QpSummary& summary, double seconds, QpTotal* total) {
  total->seconds += seconds;
  total->frames_with_qp += summary.solved > 0;
  total->problems += summary.solved;
  total->failed += summary.failed;
}

struct FrameTime {  // [s]
  double collision_qp = INFINITY, static_qp = INFINITY, freeze = INFINITY, step = INFINITY;
};

RunTotal RunAgain(const BenchScene& scene, const Settings& settings, std::vector<FrameTime>* least) {
  BuiltScene built = BuildScene(*FindScene(scene.name), scene.parameters, settings);
  RunTotal total;
  for (FrameTime& time : *least) {
    const StepReport report = built.world.Step(1.0 / 30);
    time.collision_qp = std::min(time.collision_qp, report.collision_qp.seconds);
    time.static_qp = std::min(time.static_qp, report.static_qp.seconds);
    time.freeze = std::min(time.freeze, report.seconds.freeze);
    time.step = std::min(time.step, report.seconds.Total());
    Add(report.collision_qp, time.collision_qp, &total.collision);
    Add(report.static_qp, time.static_qp, &total.resting);
    total.freeze_seconds += time.freeze;
    total.step_seconds += time.step;
    total.active_contacts += report.active_contacts;
    total.awake += report.awake;
    total.awake_at_end = report.awake;
    ++total.frames;
  }
  total.hash = built.world.StateHash();
  return total;
}

RunTotal Run(const BenchScene& scene, Method method, Freezing freezing) {
  const Settings settings = MakeSettings(method, freezing, scene.freeze_count);
  std::vector<FrameTime> least(static_cast<size_t>(scene.frames));
  RunTotal total = RunAgain(scene, settings, &least);
  for (int repeat = 1; repeat < scene.repeats; ++repeat) {
    const RunTotal again = RunAgain(scene, settings, &least);
    if (again.hash != total.hash)
      throw std::logic_error(std::string(scene.name) + ": two runs of the same scene differ");
    total = again;
  }
  return total;
}

// The run without freezing serves every row that is compared with it.
const RunTotal& RunOnce(const BenchScene& scene, Method method, Freezing freezing) {
  static std::map<std::tuple<std::string, Method, Freezing>, RunTotal> done;
  const auto key = std::tuple(std::string(scene.name), method, freezing);
  const auto found = done.find(key);
  return found != done.end() ? found->second : done.emplace(key, Run(scene, method, freezing)).first->second;
}

void ReportQp(const std::string& name, const QpTotal& qp, const RunTotal& total, benchmark::State* state) {
  state->counters[name + "_s/frame"] = qp.seconds / total.frames;
  state->counters[name + "_s/solved"] = qp.SecondsPerSolved();
  state->counters[name + "_solved"] = qp.frames_with_qp;
  state->counters[name + "_islands"] = qp.problems;
  state->counters[name + "_failed"] = qp.failed;
}

void ReportRatios(const std::string& name, const QpTotal& off, const QpTotal& on, benchmark::State* state) {
  state->counters[name + "_off/on_frame"] = off.seconds / on.seconds;
  state->counters[name + "_off/on_solved"] = off.SecondsPerSolved() / on.SecondsPerSolved();
}
double QpSeconds(const RunTotal& total) { return total.collision.seconds + total.resting.seconds; }

void FreezingRun(benchmark::State& state, const BenchScene& scene, Method method, Freezing freezing) {
  for (auto _ : state) {
    const RunTotal& on = RunOnce(scene, method, freezing);
    state.SetIterationTime(on.step_seconds);
    state.counters["frames"] = on.frames;
    state.counters["contacts"] = on.active_contacts / on.frames;
    state.counters["awake"] = on.awake / on.frames;
    state.counters["awake_end"] = on.awake_at_end;
    state.counters["freeze_s/frame"] = on.freeze_seconds / on.frames;
    ReportQp("co", on.collision, on, &state);
    ReportQp("st", on.resting, on, &state);
    if (freezing == Freezing::kOff) continue;
    const RunTotal& off = RunOnce(scene, method, Freezing::kOff);
    ReportRatios("co", off.collision, on.collision, &state);
    ReportRatios("st", off.resting, on.resting, &state);
    state.counters["qp_off/on_frame"] = QpSeconds(off) / QpSeconds(on);
    state.counters["step_off/on"] = off.step_seconds / on.step_seconds;
  }
}

void RegisterAll() {
  for (const BenchScene& scene : kScenes) {
    for (const auto& [method, method_name] : kMethods) {
      for (const auto& [freezing, freezing_name] : kFreezings) {
        const std::string name = std::string(scene.name) + "/" + method_name + "/" + freezing_name;
        benchmark::RegisterBenchmark(name.c_str(), FreezingRun, scene, method, freezing)
            ->Iterations(1)
            ->UseManualTime()
            ->Unit(benchmark::kSecond);
      }
    }
  }
}

}  // namespace
}  // namespace islet

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  islet::RegisterAll();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
