// Runs scenes with every setting of one engine (the one that is linked in) and appends a row each to a CSV file.
//
//   chart_islet --out islet.csv --scene stack10 --quick
//   chart_bullet --list
//
// A new file begins with lines that start with # and tell machine, compiler, commit, engine; then the names of the columns.
// Rows also hold the load of the machine when the run began: timings under load are no more than upper bounds.
#include <sys/utsname.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "bench/charts/run.h"
#include "bench/machine.h"

namespace islet::charts {
namespace {

constexpr int kCutExit = 4;  // the budget was spent before all settings had run

struct Options {
  std::string out;
  std::vector<std::string> scenes;
  bool quick = false, rest = false;
  std::vector<std::string> cuts;
  bool list = false;
  int start = 0;
  double limit = 0;   // [s]; 0: the scene's own
  double budget = 0;  // [s]; 0: as long as it takes
};

void WriteHead(const peers::Engine& engine, std::ostream& out) {
  utsname system{};
  uname(&system);
  out << "# machine: " << bench::Processor() << ", " << sysconf(_SC_NPROCESSORS_ONLN) << " cores, " << system.sysname
      << ' ' << system.release << "\n# compiler: " << ISLET_COMPILER << "\n# commit: "
      << bench::FirstLineOf("git -C '" ISLET_SOURCE_DIR "' describe --always --dirty --exclude '*' 2>/dev/null")
      << "\n# engine: " << engine.name << ' ' << engine.version << ", " << engine.precision
      << "\n# load average of the machine: at the start " << bench::Load() << "; of each run in its row\n"
      << "scene,start,engine,version,precision,solver,sweep,dt,iterations,tolerance,sleeping,threads,default,failed,"
         "error,"
         "overlap_max,overlap_mean,overlap_end,drift,drift_max,creep,coulomb_error,coulomb_end,coulomb_told,coulomb_"
         "judged,jitter,"
         "kinetic_end,"
         "energy_gain,energy_ratio,"
         "momentum_error,fell_at,lost,simulated_s,wall_per_s,cpu_per_s,step_median,step_p99,memory_mib,contacts_mean,"
         "state_hash,repeats,repeatable,load\n";
}

void WriteRow(const ChartScene& scene, const peers::Engine& engine, const peers::Setting& setting, const RunResult& run,
              int start, const std::string& load, std::ostream& out) {
  const Measures& m = run.measures;
  const double per_second = run.simulated > 0 ? 1 / run.simulated : 0;
  char hash[20];
  std::snprintf(hash, sizeof hash, "%016llx", static_cast<unsigned long long>(run.hash));
  out.precision(6);
  out << scene.name << ',' << start << ',' << engine.name << ',' << engine.version << ',' << engine.precision << ','
      << setting.solver << ',' << setting.sweep << ',' << setting.dt << ',' << setting.iterations << ','
      << setting.tolerance << ',' << setting.sleeping << ',' << setting.threads << ',' << setting.is_default << ','
      << run.failed << ',' << run.error << ',' << m.overlap_max << ',' << m.overlap_mean << ',' << m.overlap_end << ','
      << m.drift << ',' << m.drift_max << ',' << m.creep << ',' << m.coulomb_error << ',' << m.coulomb_end << ','
      << m.coulomb_told << ',' << m.coulomb_judged << ',' << m.jitter << ',' << m.kinetic_end << ',' << m.energy_gain
      << ',' << m.energy_ratio << ',' << m.momentum_error << ',' << m.fell_at << ',' << m.lost << ',' << run.simulated
      << ',' << run.wall * per_second << ',' << run.cpu * per_second << ',' << run.step_median << ',' << run.step_p99
      << ',' << run.memory_kib / 1024 << ',' << run.contacts_mean << ',' << hash << ',' << run.repeats << ','
      << run.repeatable << ',' << load << '\n'
      << std::flush;
}

void List(const peers::Engine& engine) {
  for (const ChartScene& scene : AllChartScenes()) {
    std::cout << scene.name << '\t' << scene.quick << '\t' << scene.starts << '\t' << scene.few << '\t' << scene.limit
              << '\t' << scene.seconds << '\t' << scene.summary << '\t' << scene.error_name << '\t' << scene.why
              << '\n';
  }
  std::cerr << engine.name << ' ' << engine.version << ": " << engine.settings.size() << " settings\n";
}

// Whether a setting of the same sweep is at least as costly as one that was cut.
bool AsCostly(const peers::Setting& setting, const peers::Setting& cut) {
  constexpr double kSame = 1e-4;  // as printed in a CSV file
  return setting.solver == cut.solver && setting.sweep == cut.sweep && setting.sleeping == cut.sleeping &&
         setting.threads == cut.threads && setting.dt <= cut.dt * (1 + kSame) && setting.iterations >= cut.iterations &&
         setting.tolerance <= cut.tolerance * (1 + kSame);
}

// "SI,dt,0,1,0.00416667,10,0": solver, sweep, sleeping, threads, dt, iterations, tolerance, as in the CSV file.
peers::Setting ParseCut(const std::string& text) {
  std::istringstream in(text);
  peers::Setting setting;
  char comma = 0;
  std::getline(in, setting.solver, ',');
  std::getline(in, setting.sweep, ',');
  in >> setting.sleeping >> comma >> setting.threads >> comma >> setting.dt >> comma >> setting.iterations >> comma >>
      setting.tolerance;
  if (!in) throw CLI::ValidationError("--cut", text + " is no setting");
  return setting;
}

// Once a setting was cut, costlier ones of its sweep are not tried. False: no time was left for all of them.
bool RunSettings(const ChartScene& scene, const peers::Engine& engine, const Options& options, std::ostream& out) {
  Limits limits;
  limits.stepping = options.limit > 0 ? options.limit : scene.limit;
  limits.start = options.start;
  const auto began = std::chrono::steady_clock::now();
  std::vector<peers::Setting> cuts;
  for (const std::string& text : options.cuts) cuts.push_back(ParseCut(text));
  for (const peers::Setting& setting : engine.settings) {
    if (setting.quick ? options.rest : options.quick) continue;
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - began;
    if (options.budget > 0 && spent.count() > options.budget) return false;
    const std::string load = bench::Load();
    RunResult result;
    if (std::ranges::any_of(cuts, [&](const peers::Setting& cut) { return AsCostly(setting, cut); })) {
      std::snprintf(result.failed, sizeof result.failed, "not run");
    } else {
      result = RunApart(scene, engine, setting, limits);
    }
    if (std::string_view(result.failed) == "time limit" || std::string_view(result.failed) == "refused")
      cuts.push_back(setting);
    WriteRow(scene, engine, setting, result, options.start, load, out);
  }
  return true;
}

int RunAll(const Options& options, const peers::Engine& engine) {
  const bool fresh = !std::filesystem::exists(options.out);
  std::ofstream out(options.out, std::ios::app);
  if (!out) {
    std::cerr << "cannot write " << options.out << '\n';
    return EXIT_FAILURE;
  }
  if (fresh) WriteHead(engine, out);
  for (const std::string& name : options.scenes) {
    const ChartScene* scene = FindChartScene(name);
    if (scene == nullptr) {
      std::cerr << "no scene is called " << name << '\n';
      return 2;
    }
    if (options.start < 0 || options.start >= scene->starts) {
      std::cerr << name << " has " << scene->starts << " starts\n";
      return 2;
    }
    if (!RunSettings(*scene, engine, options, out)) return kCutExit;
  }
  return EXIT_SUCCESS;
}

int Main(int argc, char** argv) {
  const peers::Engine engine = peers::TheEngine();
  Options options;
  CLI::App app("Charts: every setting of " + engine.name + " " + engine.version);
  app.add_option("--out", options.out, "CSV file to append to");
  app.add_option("--scene", options.scenes, "scenes, in this order");
  app.add_flag("--quick", options.quick, "only the settings of chart-quick");
  app.add_flag("--rest", options.rest, "only the other settings")->excludes("--quick");
  app.add_option("--cut", options.cuts, "settings known to take too long: theirs and costlier ones are not run");
  app.add_flag("--list", options.list, "the scenes: name, quick, starts, few, limit, seconds, what, error, why");
  app.add_option("--start", options.start, "which of the scene's starts, from 0");
  app.add_option("--budget", options.budget, "[s] after which no further setting is begun (exit code 4)");
  app.add_option("--limit", options.limit, "[s] of stepping, after which a run is cut; default: the scene's own");
  CLI11_PARSE(app, argc, argv);
  if (options.list) {
    List(engine);
    return EXIT_SUCCESS;
  }
  if (options.out.empty() || options.scenes.empty()) {
    std::cerr << "--out and --scene are needed, or --list\n";
    return 2;
  }
  return RunAll(options, engine);
}

}  // namespace
}  // namespace islet::charts

int main(int argc, char** argv) { return islet::charts::Main(argc, argv); }
