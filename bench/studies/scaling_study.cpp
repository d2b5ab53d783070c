// How the time of a step grows: with threads, with the number of islands, with the size of one island.
//
//   study_scaling --out scaling.csv [--part threads|islands|pyramid|solver ...] [--quick] [--budget 300]
//
//   threads   manystacks and cubeglass on 1 and 2 threads, frame by frame in turn, so that both see the same machine
//   islands   n towers of five cubes at rest, freezing off, n from 1 to 10,000; the whole step
//   pyramid   one island: a square pyramid of n cubes at rest, freezing off; the whole step
//   solver    one island of n jittered cubes between walls: the static-contact problem alone, by model and effort
//
// A row is one size and setting; its times are of one step, the median over the steps (threads: the mean), in parts as the
// engine's own report has them. Sizes rise until the budget of the part is spent.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bench/answer_quality.h"
#include "bench/problem_files.h"
#include "bench/studies/study_csv.h"
#include "parallel/worker_pool.h"
#include "qp/cascade/island_solver.h"
#include "scenes/scene.h"

namespace islet::studies {
namespace {

constexpr double kFrame = 1.0 / 30;  // [s]

struct Options {
  std::string out;
  std::vector<std::string> parts{"threads", "islands", "pyramid", "solver"};
  bool quick = false;
  double budget = 300;  // [s] of each part
};

struct Row {
  std::string part = {}, scene = {}, setting = {};
  int n = 0, bodies = 0, contacts = 0, threads = 1, steps = 0;
  double wall = 0, cpu = 0;  // [s] of a step
  StageSeconds stages = {};
  double largest_share = 0;  // of the contacts, in the largest island
  double map = 0;            // natural map of exact Coulomb over v_ref, part solver alone
  std::uint64_t hash = 0;
};

class Output {
 public:
  explicit Output(const std::string& path)
      : csv_(path, {},
             "part,scene,setting,n,bodies,contacts,threads,steps,wall_s,cpu_s,detect_s,islands_s,pq_s,collision_qp_s,"
             "static_qp_s,freeze_s,move_s,largest_share,map_coulomb,state_hash") {}

  void Add(const Row& r) {
    csv_.Row(r.part, r.scene, r.setting, r.n, r.bodies, r.contacts, r.threads, r.steps, r.wall, r.cpu, r.stages.detect,
             r.stages.islands, r.stages.pq, r.stages.collision_qp, r.stages.static_qp, r.stages.freeze, r.stages.move,
             r.largest_share, r.map, Hex(r.hash));
    Say("  scaling: " + r.part + ' ' + r.scene + ' ' + r.setting + " n " + std::to_string(r.n) + ", " +
        std::to_string(r.threads) + " threads: " + std::to_string(1e3 * r.wall) + " ms");
  }

 private:
  StudyCsv csv_;
};

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<long>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

int CountMoving(const World& world) {
  return static_cast<int>(std::count_if(world.bodies().begin(), world.bodies().end(),
                                        [](const Body& b) { return b.kind == BodyKind::kDynamic; }));
}

// Steps of one world, collected.
class Steps {
 public:
  void Step(World* world) {
    const StudyClock clock;
    const StepReport report = world->Step(kFrame);
    wall_.push_back(clock.Wall()), cpu_.push_back(clock.Cpu());
    const StageSeconds& s = report.seconds;
    const double values[] = {s.detect, s.islands, s.pq, s.collision_qp, s.static_qp, s.freeze, s.move};
    for (size_t i = 0; i < stages_.size(); ++i) stages_[i].push_back(values[i]);
    contacts_ += report.active_contacts, largest_ += report.largest_island_contacts;
  }
  double spent() const { return Sum(wall_); }
  int count() const { return static_cast<int>(wall_.size()); }

  using Average = std::function<double(const std::vector<double>&)>;
  void Fill(const World& world, const Average& average, Row* row) const {
    row->wall = average(wall_), row->cpu = average(cpu_), row->steps = count();
    row->bodies = CountMoving(world);
    row->contacts = static_cast<int>(contacts_ / std::max(1, count()));
    row->largest_share = contacts_ > 0 ? largest_ / contacts_ : 0;
    StageSeconds& s = row->stages;
    double* places[] = {&s.detect, &s.islands, &s.pq, &s.collision_qp, &s.static_qp, &s.freeze, &s.move};
    for (size_t i = 0; i < stages_.size(); ++i) *places[i] = average(stages_[i]);
    row->hash = world.StateHash();
  }
  static double Mean(const std::vector<double>& values) { return Sum(values) / static_cast<double>(values.size()); }

 private:
  static double Sum(const std::vector<double>& values) {
    double sum = 0;
    for (const double x : values) sum += x;
    return sum;
  }
  std::vector<double> wall_, cpu_;
  std::array<std::vector<double>, 7> stages_;
  double contacts_ = 0, largest_ = 0;
};

Settings MakeSettings(int threads, bool freezing) {
  Settings settings;
  settings.threads = threads;
  settings.freezing = freezing ? Freezing::kCertified : Freezing::kOff;
  return settings;
}

void Threads(const Options& options, Output* out) {
  struct Case {
    const char* scene;
    SceneParameters parameters;
    bool freezing;
    int frames;
    bool quick;
  };
  const std::vector<Case> cases{
      {"manystacks", {.count = 1000, .drop = 0.1}, false, 30, false},
      {"manystacks", {.count = 100, .drop = 0.1}, false, 90, true},
      {"cubeglass", {.count = 300}, false, 150, true},
      {"cubeglass", {}, false, 180, false},
      {"cubeglass", {}, true, 300, false},
  };
  const StudyClock clock;
  for (const Case& c : cases) {
    if (options.quick && !c.quick) continue;
    std::vector<World> worlds;
    std::vector<Steps> steps(2);
    for (const int threads : {1, 2})
      worlds.push_back(BuildScene(*FindScene(c.scene), c.parameters, MakeSettings(threads, c.freezing)).world);
    for (int frame = 0; frame < c.frames && clock.Wall() < options.budget; ++frame) {
      for (int k = 0; k < 2; ++k) steps[(frame + k) % 2].Step(&worlds[(frame + k) % 2]);
    }
    for (int k = 0; k < 2 && steps[k].count() > 0; ++k) {
      Row row{.part = "threads", .scene = c.scene, .setting = c.freezing ? "freezing" : "awake"};
      row.n = c.parameters.count.value_or(FindScene(c.scene)->default_count);
      row.threads = k + 1;
      steps[k].Fill(worlds[k], Steps::Mean, &row);
      out->Add(row);
    }
    if (worlds[0].StateHash() != worlds[1].StateHash()) throw std::logic_error("one and two threads differ");
  }
}

// Steps a world that rests: a few to warm up, then until there are enough. False if the budget does not allow another size.
bool StepAtRest(World* world, double budget, Row* row, Output* out) {
  constexpr int kWarmUp = 10, kLeast = 20,
                kMost = 60;                      // the first steps are not like the later ones: so many for all sizes
  constexpr double kEnough = 0.5, kPlenty = 20;  // [s]
  Steps warm_up, steps;
  for (int i = 0; i < kWarmUp && warm_up.spent() < std::min(0.5 * budget, 0.5 * kPlenty); ++i) warm_up.Step(world);
  while (steps.count() < kMost && (steps.count() < kLeast || steps.spent() < kEnough)) {
    steps.Step(world);
    if (steps.spent() > std::min(budget, kPlenty)) break;
  }
  steps.Fill(*world, Median, row);
  out->Add(*row);
  return steps.spent() + warm_up.spent() < budget;
}

void Islands(const Options& options, Output* out) {
  const std::vector<int> counts =
      options.quick ? std::vector{1, 10, 100, 1000} : std::vector{1, 3, 10, 30, 100, 200, 500, 1000, 2000, 5000, 10000};
  const StudyClock clock;
  for (const int count : counts) {
    for (const int threads : {1, 2}) {
      World world = BuildScene(*FindScene("manystacks"), {.count = count}, MakeSettings(threads, false)).world;
      Row row{.part = "islands", .scene = "manystacks", .setting = "awake", .n = count, .threads = threads};
      if (!StepAtRest(&world, options.budget - clock.Wall(), &row, out)) return;
    }
  }
}

// Layers of k x k cubes, each cube on four of the layer below; 0.02 m between the cubes of a layer, so that none touch.
World BuildPyramid(int layers, const Settings& settings) {
  constexpr double kPitch = 1.02;  // [m]
  World world(settings);
  world.Add({.shape = Shape::HalfSpace(), .kind = BodyKind::kFixed});
  for (int level = 0; level < layers; ++level) {
    const int side = layers - level;
    for (int i = 0; i < side * side; ++i)
      world.Add({.shape = Shape::Box({0.5, 0.5, 0.5}),
                 .mass = 1,
                 .position_W = {(i % side - 0.5 * (side - 1)) * kPitch, (i / side - 0.5 * (side - 1)) * kPitch,
                                level + 0.5}});
  }
  return world;
}

void Pyramid(const Options& options, Output* out) {
  const std::vector<int> layers = options.quick ? std::vector{3, 5, 8} : std::vector{3, 5, 8, 12, 17, 24, 30, 38};
  const StudyClock clock;
  for (const int k : layers) {
    World world = BuildPyramid(k, MakeSettings(1, false));
    Row row{.part = "pyramid", .scene = "pyramid", .setting = "certified", .n = k * (k + 1) * (2 * k + 1) / 6};
    if (!StepAtRest(&world, options.budget - clock.Wall(), &row, out)) return;
  }
}

struct Way {
  const char* name;
  qp::Model model;
  qp::Effort effort;
};

// One solve in a task of a pool, as the engine runs it, by a solver that has seen nothing before; repeated while that is cheap.
void SolvePile(const qp::Island& island, const Way& way, int threads, Row* row) {
  constexpr int kMost = 5;
  constexpr double kEnough = 1;  // [s]
  qp::Settings settings;
  settings.model = way.model, settings.effort = way.effort, settings.velocity_scale = island.scale;
  parallel::WorkerPool pool(threads);
  qp::Solution solution;
  std::vector<double> wall, cpu;
  double spent = 0;
  while (wall.size() < kMost && spent < kEnough) {
    const StudyClock clock;
    pool.ForEach(1, [&](int, int) { qp::IslandSolver().Solve(island.problem, settings, &solution); });
    wall.push_back(clock.Wall()), cpu.push_back(clock.Cpu());
    spent += wall.back();
  }
  row->wall = Median(wall), row->cpu = Median(cpu);
  row->steps = static_cast<int>(wall.size());
  row->map = qp::Judge(island, solution).rms;
  std::uint64_t hash = 14695981039346656037ull;  // FNV-1a over the velocities
  const auto* bytes = reinterpret_cast<const unsigned char*>(solution.velocities.data());
  for (size_t i = 0; i < solution.velocities.size() * sizeof(double); ++i) hash = (hash ^ bytes[i]) * 1099511628211ull;
  row->hash = hash;
}

void Solver(const Options& options, Output* out) {
  constexpr Way kWays[] = {{"convex", qp::Model::kConvex, qp::kNormalEffort},
                           {"thorough", qp::Model::kCoulomb, qp::kThoroughEffort},
                           {"normal", qp::Model::kCoulomb, qp::kNormalEffort}};
  const std::vector<std::array<int, 3>> all{{3, 2, 2},    {3, 3, 3},    {5, 4, 4},    {6, 6, 6},    {8, 8, 7},
                                            {10, 10, 10}, {13, 13, 12}, {17, 17, 17}, {22, 21, 21}, {27, 27, 27}};
  const std::vector<std::array<int, 3>> sizes(all.begin(), options.quick ? all.begin() + 6 : all.end());
  const StudyClock clock;
  std::map<std::string, std::pair<int, double>> last;  // by way: bodies, [s]
  for (const auto& [nx, ny, nz] : sizes) {
    const qp::Island island = qp::MakePile(nx, ny, nz);
    for (const Way& way : kWays) {
      for (const int threads : {1, 2}) {
        if (threads > 1 && way.model == qp::Model::kConvex) continue;
        // Time grows with about the square of the size: what would not end within the budget is not begun.
        const auto [n_before, seconds] = last[way.name];
        const double growth = n_before > 0 ? static_cast<double>(nx * ny * nz) / n_before : 1;
        if (clock.Wall() + seconds * growth * growth > options.budget) continue;
        Row row{.part = "solver", .scene = "pile", .setting = way.name, .n = nx * ny * nz, .threads = threads};
        row.bodies = row.n, row.contacts = island.problem.num_contacts(), row.largest_share = 1;
        SolvePile(island, way, threads, &row);
        out->Add(row);
        last[way.name] = {row.n, row.wall};
      }
    }
  }
}

void RunAll(const Options& options) {
  Output out(options.out);
  for (const std::string& part : options.parts) {
    if (part == "threads") Threads(options, &out);
    if (part == "islands") Islands(options, &out);
    if (part == "pyramid") Pyramid(options, &out);
    if (part == "solver") Solver(options, &out);
  }
}

}  // namespace
}  // namespace islet::studies

int main(int argc, char** argv) {
  islet::studies::Options options;
  CLI::App app("How the time of a step grows");
  app.add_option("--out", options.out, "CSV file")->required();
  app.add_option("--part", options.parts, "threads, islands, pyramid, solver (all)")
      ->check(CLI::IsMember({"threads", "islands", "pyramid", "solver"}));
  app.add_flag("--quick", options.quick, "small sizes alone");
  app.add_option("--budget", options.budget, "[s] of each part");
  return islet::studies::RunStudy(&app, argc, argv, [&] { islet::studies::RunAll(options); });
}
