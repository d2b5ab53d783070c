// Whole solves of an island: models, cones, efforts, threads, cold and warm; against size; small islands; effort against effort.
//
//   ISLET_PROBLEMS=folder bench_solver                       the largest islands of measured frames, then piles of our own
//   bench_solver --benchmark_filter=whole/                   whole solves; also size/, small/, efforts/
//
// What the columns mean and what was measured: bench/README.md, "Whole solves" to "Efforts".
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "bench/answer_quality.h"
#include "bench/cholmod_factor.h"
#include "bench/problem_files.h"
#include "bench/stopwatch.h"
#include "parallel/worker_pool.h"
#include "qp/cascade/island_solver.h"

namespace islet::qp {
namespace {

using Make = std::function<Island()>;

constexpr double kMapTolerance = 1e-6;  // of the natural map, over v_ref
constexpr double kPerturbation = 0.01;  // [m/s] of each body's velocity, for warm starts
constexpr int kTurns = 5;               // the median counts
constexpr int kSmallBatch = 64;         // different islands that are solved one after the other

struct Way {
  const char* name;
  Model model;
  Cone cone;
  Effort effort;
  double tolerance;
};
constexpr std::array<Way, 6> kWays{{
    {"convex/circular/1e-4", Model::kConvex, Cone::kCircular, kNormalEffort, 1e-4},
    {"convex/circular", Model::kConvex, Cone::kCircular, kNormalEffort, 1e-6},
    {"convex/octagon", Model::kConvex, Cone::kOctagon, kNormalEffort, 1e-6},
    {"coulomb/octagon", Model::kCoulomb, Cone::kOctagon, kNormalEffort, 1e-6},
    {"coulomb/circular/thorough", Model::kCoulomb, Cone::kCircular, kThoroughEffort, 1e-6},
    {"coulomb/circular/normal", Model::kCoulomb, Cone::kCircular, kNormalEffort, 1e-6},
}};

Settings MakeSettings(const Island& island, const Way& way) {
  Settings settings;
  settings.model = way.model, settings.cone = way.cone, settings.effort = way.effort;
  settings.tolerance = way.tolerance;
  settings.velocity_scale = island.scale;
  return settings;
}

double Median(std::vector<double> values) {
  if (values.empty()) return NAN;
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// [s] of the turns. CPU: of the calling thread, which other programs on the machine disturb less than the wall clock.
struct Times {
  std::vector<double> cpu, wall;

  void Add(const Stopwatch& watch) { cpu.push_back(watch.Cpu()), wall.push_back(watch.Wall()); }
};

// A solver on so many threads, timed inside of a task of the pool as the engine runs it.
class Contestant {
 public:
  explicit Contestant(int threads) : pool_(threads), other_(MakePile(2, 2, 1)) {}

  // Before each timed solve another problem is solved, so that the symbolic phase counts, as in a scene that moves.
  void Turn(const Island& island, const Settings& settings, std::span<const Vector3> start) {
    Settings convex;
    convex.model = Model::kConvex;
    pool_.ForEach(1, [&](int, int) {
      solver_.Solve(other_.problem, convex, &solution);
      const Stopwatch watch;
      solver_.Solve(island.problem, settings, &solution, start);
      times_.Add(watch);
    });
  }
  double Cpu() const { return Median(times_.cpu); }
  double Wall() const { return Median(times_.wall); }
  void Forget() { times_ = {}; }

  Solution solution;

 private:
  parallel::WorkerPool pool_;
  Island other_;
  IslandSolver solver_;
  Times times_;
};

// The impulses of the same island with other velocities, as if from the frame before.
std::vector<Vector3> WarmStart(const Island& island, const Settings& settings) {
  std::mt19937 engine(11);
  Problem before = island.problem;
  for (BodyTerm& body : before.bodies) {
    Vector3 change;
    for (double& x : change) x = static_cast<double>(engine()) / 4294967296.0 - 0.5;
    body.velocity.head<3>() += kPerturbation * change.normalized();
  }
  IslandSolver solver;
  Solution solution;
  solver.Solve(before, settings, &solution);
  return solution.impulses;
}

void ReportAnswer(const Island& island, const Solution& solution, benchmark::State* state) {
  const Quality quality = Judge(island, solution);
  state->counters["contacts"] = island.problem.num_contacts();
  state->counters["bodies"] = island.problem.num_bodies();
  state->counters["factorisations"] = solution.iterations;
  state->counters["solved"] = solution.status == Status::kSolved;
  state->counters["map_rms"] = quality.rms;
  state->counters["map_max"] = quality.max;
  state->counters["gap"] = quality.gap;
}

void WholeSolve(benchmark::State& state, const Make& make, const Way& way, bool warm) {
  const Island island = make();
  const Settings settings = MakeSettings(island, way);
  const std::vector<Vector3> start = warm ? WarmStart(island, settings) : std::vector<Vector3>();
  Contestant one(1), two(2);
  CholmodFactor cholmod(island.problem);
  Times units;
  one.Turn(island, settings, start), two.Turn(island, settings, start);  // memory
  one.Forget(), two.Forget();
  for (auto _ : state) {  // in turns: all see the same machine
    one.Turn(island, settings, start);
    two.Turn(island, settings, start);
    const Stopwatch watch;
    if (cholmod.Turn()) units.Add(watch);
  }
  if (one.solution.velocities != two.solution.velocities) state.SkipWithError("one and two threads differ");
  ReportAnswer(island, one.solution, &state);
  state.counters["one_ms"] = 1e3 * one.Cpu();
  state.counters["two_ms"] = 1e3 * two.Wall();
  state.counters["one/two"] = one.Wall() / two.Wall();
  if (units.cpu.empty()) return;
  state.counters["cholmod_ms"] = 1e3 * Median(units.cpu);
  state.counters["one/cholmod"] = one.Cpu() / Median(units.cpu);
  state.counters["two/cholmod"] = two.Wall() / Median(units.wall);
}

// Edges of the pile; the first has only one contact of its cube left.
constexpr std::array<std::array<int, 3>, 10> kSizes{{{1, 1, 1},
                                                     {1, 1, 1},
                                                     {2, 1, 1},
                                                     {2, 2, 2},
                                                     {3, 3, 2},
                                                     {4, 4, 4},
                                                     {6, 6, 5},
                                                     {8, 8, 8},
                                                     {10, 10, 10},
                                                     {14, 13, 12}}};

struct Point {
  double contacts, seconds;
};

// Slope of log seconds over log contacts, least squares.
double Slope(std::span<const Point> points) {
  double x = 0, y = 0, xx = 0, xy = 0;
  const double n = static_cast<double>(points.size());
  for (const Point& p : points) {
    const double a = std::log(p.contacts), b = std::log(p.seconds);
    x += a, y += b, xx += a * a, xy += a * b;
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

// growth: the exponent from the size before to this one; fit: over all sizes of 100 contacts and more so far.
void Size(benchmark::State& state, int size, const Way& way) {
  static std::map<std::string, std::vector<Point>> points;
  Island island = MakePile(kSizes[size][0], kSizes[size][1], kSizes[size][2]);
  if (size == 0) island.problem.contacts.resize(1);
  const Settings settings = MakeSettings(island, way);
  Contestant one(1);
  one.Turn(island, settings, {});
  one.Forget();
  for (auto _ : state) one.Turn(island, settings, {});
  ReportAnswer(island, one.solution, &state);
  state.counters["one_ms"] = 1e3 * one.Cpu();
  std::vector<Point>& past = points[way.name];
  past.push_back({static_cast<double>(island.problem.num_contacts()), one.Cpu()});
  if (past.size() > 1) state.counters["growth"] = Slope(std::span(past).last(2));
  const auto large = std::find_if(past.begin(), past.end(), [](const Point& p) { return p.contacts >= 100; });
  if (past.end() - large > 1) state.counters["fit"] = Slope(std::span(large, past.end()));
}

void Small(benchmark::State& state, const std::function<Island(unsigned)>& make, const Way& way, int threads) {
  std::vector<Island> islands;
  for (unsigned seed = 1; seed <= kSmallBatch; ++seed) islands.push_back(make(seed));
  parallel::WorkerPool pool(threads);
  std::vector<IslandSolver> solvers(static_cast<size_t>(threads));
  std::vector<Solution> solutions(kSmallBatch);
  for (auto _ : state) {
    pool.ForEach(kSmallBatch, [&](int i, int worker) {
      solvers[worker].Solve(islands[i].problem, MakeSettings(islands[i], way), &solutions[i]);
    });
  }
  double largest = 0, reached = 0, factorisations = 0;
  for (int i = 0; i < kSmallBatch; ++i) {
    const double map = Judge(islands[i], solutions[i]).rms;
    largest = std::max(largest, map);
    reached += map <= kMapTolerance;
    factorisations += solutions[i].iterations;
  }
  state.counters["contacts"] = islands[0].problem.num_contacts();
  state.counters["factorisations"] = factorisations / kSmallBatch;
  state.counters["map_largest"] = largest;
  state.counters["map_reached"] = reached / kSmallBatch;
  state.counters["us"] = benchmark::Counter(
      1e-6 * kSmallBatch, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["islands/s"] = benchmark::Counter(kSmallBatch, benchmark::Counter::kIsIterationInvariantRate);
}

// The least time of all settings of the effort whose answer has a map (rms, over v_ref) of at most the goal.
void Efforts(benchmark::State& state, const Make& make, const Way& way) {
  constexpr std::array<double, 3> kGoals{1e-3, 1e-4, 1e-5};
  constexpr std::array<const char*, 3> kNames{"1e-3_ms", "1e-4_ms", "1e-5_ms"};
  const Island island = make();
  Settings settings = MakeSettings(island, way);
  Contestant one(1);
  std::array<double, 3> least{INFINITY, INFINITY, INFINITY};
  double best = INFINITY;
  for (auto _ : state) {
    for (const double map : {3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6}) {
      settings.tolerance = map;
      one.Forget();
      for (int turn = 0; turn < 3; ++turn) one.Turn(island, settings, {});
      const double reached = Judge(island, one.solution).rms;
      best = std::min(best, reached);
      for (size_t i = 0; i < kGoals.size(); ++i)
        if (reached <= kGoals[i]) least[i] = std::min(least[i], one.Cpu());
    }
  }
  state.counters["contacts"] = island.problem.num_contacts();
  for (size_t i = 0; i < kGoals.size(); ++i)
    if (std::isfinite(least[i])) state.counters[kNames[i]] = 1e3 * least[i];
  state.counters["best_map"] = best;
}

void RegisterIsland(const std::string& name, const Make& make) {
  for (const Way& way : kWays) {
    const bool uses_start = way.model == Model::kCoulomb && way.cone == Cone::kCircular;
    for (const bool warm : {false, true}) {
      if (warm && !uses_start) continue;
      const std::string row = "whole/" + name + "/" + way.name + (warm ? "/warm" : "/cold");
      benchmark::RegisterBenchmark(row.c_str(), WholeSolve, make, way, warm)
          ->Iterations(kTurns)
          ->Unit(benchmark::kMillisecond);
    }
    if (!uses_start) continue;
    benchmark::RegisterBenchmark(("efforts/" + name + "/" + way.name).c_str(), Efforts, make, way)
        ->Iterations(1)
        ->Unit(benchmark::kSecond);
  }
}

void RegisterSmall(const std::string& name, const std::function<Island(unsigned)>& make) {
  for (const Way& way : kWays) {
    for (const int threads : {1, 2}) {
      const std::string row = "small/" + name + "/" + way.name + "/" + std::to_string(threads);
      auto* bench = benchmark::RegisterBenchmark(row.c_str(), Small, make, way, threads);
      bench->MinTime(0.05)->Repetitions(5)->ReportAggregatesOnly(true)->Unit(benchmark::kMillisecond);
      if (threads > 1) bench->UseRealTime();
    }
  }
}

void RegisterAll() {
  for (const auto& file : MeasuredFrames()) {
    RegisterIsland(file.stem().string(), [file] { return ReadLargestIsland(file); });
  }
  RegisterIsland("pile_1000", [] { return MakePile(10, 10, 10); });
  for (const Way& way : kWays) {
    if (way.cone != Cone::kCircular) continue;
    for (size_t size = 0; size < kSizes.size(); ++size) {
      const std::string row = "size/" + std::string(way.name) + "/" + std::to_string(size);
      benchmark::RegisterBenchmark(row.c_str(), Size, static_cast<int>(size), way)
          ->Iterations(kTurns)
          ->Unit(benchmark::kMillisecond);
    }
  }
  for (const int cubes : {1, 2, 5, 10}) {
    RegisterSmall("tower_" + std::to_string(cubes), [cubes](unsigned seed) { return MakeTower(cubes, seed); });
    RegisterSmall("pile_" + std::to_string(cubes), [cubes](unsigned seed) {
      return cubes < 5 ? MakePile(cubes, 1, 1, seed) : MakePile(5, cubes / 5, 1, seed);
    });
  }
}

}  // namespace
}  // namespace islet::qp

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  if (!islet::qp::CholmodFactor::Available()) {
    std::fprintf(stderr, "built without CHOLMOD and OpenBLAS: no ratios to a factorisation of theirs\n");
  }
  islet::qp::RegisterAll();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
