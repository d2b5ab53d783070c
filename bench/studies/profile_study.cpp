// Time and exactness of solvers on island problems, for performance profiles: every solver on every problem, at a ladder of
// tolerances. One thread. Rows of one problem are measured one after the other.
//
//   study_profile --out profile.csv --problems FOLDER [--problems FOLDER ...] [--per-class 3] [--budget 120] [--limit 10]
//
// FOLDER holds problems (*.hdf5), or folders of problems. Of each folder and each class of sizes (1 to 10, 100, 1,000, more
// contacts) so many problems are taken, evenly by name. A ladder ends at 1e-9, or when an attempt took longer than the limit.
// What is not reached within the budget is left out problem by problem, never solver by solver.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "bench/studies/ipopt_solver.h"
#include "bench/studies/reference_interior_point.h"
#include "bench/studies/study_csv.h"
#include "bench/studies/study_problem.h"
#include "qp/cascade/island_solver.h"

namespace islet::studies {
namespace {

namespace fs = std::filesystem;

constexpr double kLadder[] = {1e-2, 1e-3, 1e-5, 1e-6, 1e-8, 1e-10};
constexpr double kExactEnough = 1e-9;   // no rung beyond
constexpr double kRepeatSeconds = 0.1;  // an attempt is repeated until so much time has gone
constexpr int kRepeats = 5;
constexpr double kSaturationSeconds = 0.02;  // where that costs something, the same bits at two rungs end the ladder

struct Options {
  std::string out;
  std::vector<std::string> folders;
  int per_class = 3;
  double budget = 120;  // [s]
  double limit = 10;    // [s] of one attempt
};

struct Attempt {
  bool solved = false;
  int iterations = 0;
  double wall = 0, cpu = 0;  // [s] median of the repeats
  int repeats = 0;
  Exactness exactness;
  std::uint64_t hash = 0;
};

struct Solver {
  std::string name;
  qp::Model model;
  qp::Cone cone;
  std::function<bool(const StudyProblem&)> takes;
  std::function<Attempt(const StudyProblem&, double tolerance, double limit)> run;
};

std::uint64_t HashOf(const double* values, size_t count) {  // FNV-1a over the bytes
  std::uint64_t hash = 14695981039346656037ull;
  for (size_t i = 0; i < count * sizeof(double); ++i)
    hash = (hash ^ reinterpret_cast<const unsigned char*>(values)[i]) * 1099511628211ull;
  return hash;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<long>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

// Runs `solve` until enough time has gone; fills the times.
void Repeat(const std::function<void()>& solve, Attempt* attempt) {
  std::vector<double> wall, cpu;
  double spent = 0;
  do {
    const StudyClock clock;
    solve();
    wall.push_back(clock.Wall()), cpu.push_back(clock.Cpu());
    spent += wall.back();
  } while (spent < kRepeatSeconds && static_cast<int>(wall.size()) < kRepeats);
  attempt->wall = Median(wall), attempt->cpu = Median(cpu);
  attempt->repeats = static_cast<int>(wall.size());
}

Attempt RunIslet(const StudyProblem& problem, qp::Model model, qp::Cone cone, qp::Effort effort, double tolerance) {
  qp::Settings settings;
  settings.model = model, settings.cone = cone, settings.effort = effort;
  settings.tolerance = tolerance;
  settings.aim = std::max(1e-15, 1e-2 * tolerance * tolerance);
  settings.velocity_scale = problem.solve.v_ref;
  Attempt attempt;
  qp::Solution solution;
  // A solver of its own each time: as those of others, it orders and allocates anew.
  Repeat([&] { qp::IslandSolver().Solve(problem.island.problem, settings, &solution); }, &attempt);
  attempt.solved = solution.status == qp::Status::kSolved;
  attempt.iterations = solution.iterations;
  attempt.exactness = JudgeIsland(problem, solution, model, cone);
  attempt.hash = HashOf(solution.velocities.data(), solution.velocities.size());
  return attempt;
}

// Problems that are not of rigid bodies, by qp::DenseSolver.
Attempt RunDense(const StudyProblem& problem, qp::Model model, qp::Cone cone, double tolerance) {
  Attempt attempt;
  SolveAnswer answer;
  Repeat([&] { answer = SolveBy(false, problem.solve, {.model = model, .cone = cone, .tolerance = tolerance}); },
         &attempt);
  attempt.solved = answer.status == qp::Status::kSolved;
  attempt.iterations = answer.iterations;
  attempt.exactness = JudgeAnswer(problem, answer, model, cone);
  attempt.hash = HashOf(answer.r.data(), static_cast<size_t>(answer.r.size()));
  return attempt;
}

Attempt RunGeneral(const StudyProblem& problem, const std::function<GeneralAnswer()>& solve) {
  Attempt attempt;
  GeneralAnswer found;
  Repeat([&] { found = solve(); }, &attempt);
  attempt.solved = found.solved, attempt.iterations = found.iterations;
  if (found.j.size() != 3 * problem.num_contacts() || !found.j.allFinite()) {
    attempt.exactness = {INFINITY, INFINITY, INFINITY};
    return attempt;
  }
  SolveAnswer answer;
  answer.r = found.j;
  // Impulses outside their cone by rounding are put back: the map would count them, and so does nobody's user.
  for (int c = 0; c < problem.num_contacts(); ++c)
    answer.r.segment<3>(3 * c) =
        ProjectOn(answer.r.segment<3>(3 * c), problem.general.friction[c], qp::Cone::kCircular);
  found.j = answer.r;
  RestoreMomentum(problem.general, &found);
  answer.u = problem.general.coupling.transpose() * found.v + problem.general.drift;
  answer.v = problem.solve.file.global ? found.v : Eigen::VectorXd();
  attempt.exactness = JudgeAnswer(problem, answer, qp::Model::kConvex, qp::Cone::kCircular);
  attempt.hash = HashOf(answer.r.data(), static_cast<size_t>(answer.r.size()));
  return attempt;
}

Solver IsletSolver(const std::string& name, qp::Model model, qp::Cone cone, qp::Effort effort) {
  const bool dense = model != qp::Model::kKinetic && name != "islet normal";
  return {name, model, cone, [dense](const StudyProblem& p) { return p.rigid || (dense && FitsDense(p.solve)); },
          [=](const StudyProblem& p, double tolerance, double) {
            return p.rigid ? RunIslet(p, model, cone, effort, tolerance) : RunDense(p, model, cone, tolerance);
          }};
}

std::vector<Solver> AllSolvers() {
  using enum qp::Model;
  using enum qp::Cone;
  std::vector<Solver> solvers{
      IsletSolver("islet thorough", kCoulomb, kCircular, qp::kThoroughEffort),
      IsletSolver("islet normal", kCoulomb, kCircular, qp::kNormalEffort),
      IsletSolver("islet", kCoulomb, kOctagon, qp::kNormalEffort),
      IsletSolver("islet", kConvex, kCircular, qp::kNormalEffort),
      IsletSolver("islet", kConvex, kOctagon, qp::kNormalEffort),
      IsletSolver("islet", kKinetic, kCircular, qp::kNormalEffort),
      IsletSolver("islet", kKinetic, kOctagon, qp::kNormalEffort),
  };
  if (ReferenceAvailable()) {
    solvers.push_back({"reference", kConvex, kCircular, [](const StudyProblem& p) { return FitsReference(p.general); },
                       [](const StudyProblem& p, double tolerance, double limit) {
                         return RunGeneral(p, [&] {
                           return SolveByReference(p.general, {.tolerance = tolerance, .seconds = limit});
                         });
                       }});
  }
  if (IpoptAvailable()) {
    solvers.push_back({"ipopt", kConvex, kCircular, [](const StudyProblem&) { return true; },
                       [](const StudyProblem& p, double tolerance, double limit) {
                         return RunGeneral(
                             p, [&] { return SolveByIpopt(p.general, {.tolerance = tolerance, .seconds = limit}); });
                       }});
  }
  return solvers;
}

const char* NameOf(qp::Model model) {
  return model == qp::Model::kKinetic ? "paper" : model == qp::Model::kConvex ? "convex" : "coulomb";
}

int ClassOf(int contacts) { return contacts <= 10 ? 0 : contacts <= 100 ? 1 : contacts <= 1000 ? 2 : 3; }

std::vector<fs::path> FilesUnder(const std::vector<std::string>& folders) {
  std::vector<fs::path> files;
  for (const std::string& folder : folders)
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.path().extension() == ".hdf5") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

// In the order in which they are solved: the first of every group, then the second, so that a budget cuts all groups alike.
std::vector<fs::path> Choose(const Options& options) {
  std::map<std::pair<std::string, int>, std::vector<fs::path>> groups;
  for (const fs::path& file : FilesUnder(options.folders)) {
    try {
      const FclibProblem problem = ReadFclib(file.string());
      if (problem.num_contacts() > 0)
        groups[{file.parent_path().string(), ClassOf(problem.num_contacts())}].push_back(file);
    } catch (const FclibError& error) {
      Say(error.what());
    }
  }
  std::vector<fs::path> chosen;
  for (int k = 0; k < options.per_class; ++k) {
    for (const auto& [group, files] : groups) {
      const size_t taken = std::min(files.size(), static_cast<size_t>(options.per_class));
      if (static_cast<size_t>(k) < taken) chosen.push_back(files[(2 * k + 1) * files.size() / (2 * taken)]);
    }
  }
  return chosen;
}

void Measure(const StudyProblem& problem, const Solver& solver, double limit, StudyCsv* csv) {
  std::uint64_t last = 0;
  for (const double tolerance : kLadder) {
    const Attempt a = solver.run(problem, tolerance, limit);
    csv->Row(problem.family, problem.name, problem.num_contacts(), problem.solve.bodies, solver.name,
             NameOf(solver.model), solver.cone == qp::Cone::kOctagon ? "octagon" : "circular", tolerance, a.solved,
             a.iterations, a.wall, a.cpu, a.repeats, a.exactness.law, a.exactness.coulomb, a.exactness.coulomb_max,
             Hex(a.hash));
    if (a.exactness.law <= kExactEnough || a.wall > limit) break;
    if (a.hash == last && a.wall > kSaturationSeconds) break;
    last = a.hash;
  }
}

void RunAll(const Options& options) {
  const std::vector<Solver> solvers = AllSolvers();
  StudyCsv csv(
      options.out, {ReferenceVersion(), IpoptVersion()},
      "family,problem,contacts,bodies,solver,model,cone,tolerance,solved,iterations,wall_s,cpu_s,repeats,map_law,"
      "map_coulomb,map_coulomb_max,state_hash");
  const std::vector<fs::path> chosen = Choose(options);
  const StudyClock clock;
  size_t done = 0;
  for (; done < chosen.size() && clock.Wall() < options.budget; ++done) {
    if (done % 10 == 0)
      Say("  profile: problem " + std::to_string(done + 1) + " of " + std::to_string(chosen.size()) + ", " +
          std::to_string(static_cast<int>(clock.Wall())) + " of at most " +
          std::to_string(static_cast<int>(options.budget)) + " s");
    try {
      const StudyProblem problem = ReadStudyProblem(chosen[done]);
      for (const Solver& solver : solvers)
        if (solver.takes(problem)) Measure(problem, solver, options.limit, &csv);
    } catch (const FclibError& error) {
      Say(error.what());
    }
  }
  if (done < chosen.size())
    Say("  profile: no time was left for " + std::to_string(chosen.size() - done) + " problems");
}

}  // namespace
}  // namespace islet::studies

int main(int argc, char** argv) {
  islet::studies::Options options;
  CLI::App app("Time and exactness of solvers on island problems");
  app.add_option("--out", options.out, "CSV file")->required();
  app.add_option("--problems", options.folders, "folders of problems in FCLIB's format")
      ->required()
      ->check(CLI::ExistingDirectory);
  app.add_option("--per-class", options.per_class, "problems of each folder and class of sizes")
      ->check(CLI::PositiveNumber);
  app.add_option("--budget", options.budget, "[s] no new problem is begun after that");
  app.add_option("--limit", options.limit, "[s] an attempt that takes longer is a solver's last on its problem");
  return islet::studies::RunStudy(&app, argc, argv, [&] { islet::studies::RunAll(options); });
}
