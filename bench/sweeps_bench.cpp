// Gauss-Seidel sweeps: what one costs on one and two threads, and how near to exact Coulomb friction how many bring an island.
//
//   ISLET_PROBLEMS=folder bench_sweeps          the largest islands of the measured frames in a folder, then piles of our own
//   bench_sweeps --benchmark_filter=pile        the piles alone
//
// What the columns mean and what was measured: bench/README.md, "Sweeps".
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "bench/problem_files.h"
#include "parallel/worker_pool.h"
#include "qp/cascade/island_solver.h"
#include "qp/gauss_seidel/gauss_seidel.h"

namespace islet::qp {
namespace {

constexpr int kTurns = 15;  // the best of these counts
constexpr int kSweepsPerTurn = 100;
constexpr int kMarks[] = {10, 30, 100, 300, 1000};

struct Start {
  std::vector<Vector3> impulses;
  std::vector<double> velocities;
};

Start ColdStart(const Problem& problem) {
  Start start{std::vector<Vector3>(problem.contacts.size(), Vector3::Zero()), {}};
  for (const BodyTerm& body : problem.bodies)
    start.velocities.insert(start.velocities.end(), body.velocity.begin(), body.velocity.end());
  return start;
}

Start ConvexAnswer(const Island& island) {
  Settings settings;
  settings.model = Model::kConvex;
  settings.velocity_scale = island.scale;
  IslandSolver solver;
  Solution solution;
  solver.Solve(island.problem, settings, &solution);
  return {solution.impulses, solution.velocities};
}

double Seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// [s] the best turn of Prepare and of a sweep.
struct Times {
  double prepare = INFINITY, sweep = INFINITY;
};

void TimeOnce(const Problem& problem, parallel::WorkerPool* pool, GaussSeidel* solver, Times* times) {
  Start start = ColdStart(problem);
  pool->ForEach(1, [&](int, int) {
    const double begin = Seconds();
    solver->Prepare(problem);
    const double middle = Seconds();
    solver->Sweep(problem, kSweepsPerTurn, 0, &start.impulses, &start.velocities);
    times->prepare = std::min(times->prepare, middle - begin);
    times->sweep = std::min(times->sweep, (Seconds() - middle) / kSweepsPerTurn);
  });
}

void Cost(benchmark::State& state, const std::function<Island()>& make) {
  const Island island = make();
  parallel::WorkerPool one(1), two(2);
  GaussSeidel solver_one, solver_two;
  Times times_one, times_two;
  for (auto _ : state) {  // in turns: both see the same machine
    TimeOnce(island.problem, &one, &solver_one, &times_one);
    TimeOnce(island.problem, &two, &solver_two, &times_two);
  }
  state.counters["contacts"] = island.problem.num_contacts();
  state.counters["bodies"] = island.problem.num_bodies();
  state.counters["one_ms"] = 1e3 * times_one.sweep;
  state.counters["two_ms"] = 1e3 * times_two.sweep;
  state.counters["one/two"] = times_one.sweep / times_two.sweep;
  state.counters["one_ns/contact"] = 1e9 * times_one.sweep / island.problem.num_contacts();
  state.counters["one_prepare_ms"] = 1e3 * times_one.prepare;
  state.counters["two_prepare_ms"] = 1e3 * times_two.prepare;
}

void Accuracy(benchmark::State& state, const std::function<Island()>& make, bool warm, Pace pace) {
  const Island island = make();
  const Problem& problem = island.problem;
  const Start start = warm ? ConvexAnswer(island) : ColdStart(problem);
  GaussSeidel solver;
  solver.Prepare(problem);
  for (auto _ : state) {
    state.counters["0"] = CoulombMap(problem, start.velocities, start.impulses).rms / island.scale;
    for (int sweeps : kMarks) {
      Start end = start;
      solver.Sweep(problem, sweeps, 0, &end.impulses, &end.velocities, pace);
      state.counters[std::to_string(sweeps)] = CoulombMap(problem, end.velocities, end.impulses).rms / island.scale;
    }
  }
}

void RegisterAll() {
  const auto add = [](const std::string& name, const std::function<Island()>& make) {
    benchmark::RegisterBenchmark((name + "/cost").c_str(), Cost, make)
        ->Iterations(kTurns)
        ->Unit(benchmark::kMillisecond);
    for (const bool warm : {false, true}) {
      for (const Pace pace : {Pace::kPlain, Pace::kMomentum}) {
        const std::string row = name + (warm ? "/warm" : "/cold") + (pace == Pace::kPlain ? "/plain" : "/momentum");
        benchmark::RegisterBenchmark(row.c_str(), Accuracy, make, warm, pace)
            ->Iterations(1)
            ->Unit(benchmark::kMillisecond);
      }
    }
  };
  for (const auto& file : MeasuredFrames()) add(file.stem().string(), [file] { return ReadLargestIsland(file); });
  for (const int edge : {2, 5, 10}) {
    add("pile_" + std::to_string(edge * edge * edge), [edge] { return MakePile(edge, edge, edge); });
  }
}

}  // namespace
}  // namespace islet::qp

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::AddCustomContext("kernels", islet::qp::BestSweepKernels().plain->name);
  islet::qp::RegisterAll();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
