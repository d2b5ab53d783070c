#include "scenes/solve.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "engine/stopwatch.h"
#include "parallel/worker_pool.h"
#include "scenes/interrupt.h"
#include "scenes/output_file.h"
#include "scenes/solve_judge.h"
#include "scenes/solve_problem.h"

namespace islet {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kWorstContact = 10;  // times the tolerance: the largest natural map of a contact in a solved problem

struct Result {
  std::string file, error;  // error: why it could not be read or solved at all
  std::string status, method;
  SolveProblem problem;
  SolveAnswer answer;
  SolveVerdict verdict;
  double seconds = 0;
  bool usable() const { return error.empty() && verdict.finite; }
};

SolveLaw LawOf(const SolveOptions& options) {
  return {options.model == "coulomb" ? qp::Model::kCoulomb : qp::Model::kConvex,
          options.cone == "circular" ? qp::Cone::kCircular : qp::Cone::kOctagon, options.tolerance};
}

bool Solved(const SolveVerdict& verdict, double tolerance) {
  return verdict.finite && verdict.natural_map_rms <= tolerance && verdict.natural_map_max <= kWorstContact * tolerance;
}

bool Better(const SolveVerdict& x, const SolveVerdict& y) {
  return x.finite && (!y.finite || x.natural_map_rms < y.natural_map_rms);
}

// The sparse way where it is open; where it does not reach the tolerance the dense one too, and the better answer counts.
void SolveAndJudge(const FclibProblem& original, const SolveOptions& options, Result* result) {
  const SolveLaw law = LawOf(options);
  const auto attempt = [&](bool sparse) {
    const Stopwatch watch;
    SolveAnswer answer = SolveBy(sparse, result->problem, law);
    result->seconds += watch.seconds();
    const SolveVerdict verdict = Judge(original, result->problem, answer, law.model, law.cone);
    if (!result->method.empty() && !Better(verdict, result->verdict)) return;
    result->answer = std::move(answer);
    result->verdict = verdict;
    result->method = sparse ? "sparse" : "dense";
  };
  // On the octagon the rounds of exact Coulomb friction are those of the dense way: it measures whether its slips are its own.
  const bool fits = FitsDense(result->problem);
  const bool sparse =
      result->problem.rigid && !(fits && law.model == qp::Model::kCoulomb && law.cone == qp::Cone::kOctagon);
  if (sparse) attempt(true);
  if (fits && !(sparse && Solved(result->verdict, options.tolerance))) {
    try {
      attempt(false);
    } catch (const FclibError&) {
      if (!sparse) throw;  // else there is an answer, and the table tells how good it is
    }
  }
  if (result->method.empty())
    throw FclibError(fmt::format("{}: {} contacts are too many for a dense matrix", result->file,
                                 result->problem.file.num_contacts()));
  const bool solved = Solved(result->verdict, options.tolerance);
  const qp::Status seen = result->answer.status;
  result->status = !result->verdict.finite           ? "failed"
                   : solved                          ? "solved"
                   : seen == qp::Status::kInfeasible ? "infeasible"
                                                     : "inaccurate";
}

Result SolveFile(const std::string& path, const SolveOptions& options, parallel::WorkerPool* pool) {
  Result result;
  result.file = path;
  try {
    const FclibProblem original = ReadFclib(path);
    result.problem = PrepareProblem(path, original);
    pool->ForEach(1, [&](int, int) { SolveAndJudge(original, options, &result); });
  } catch (const FclibError& error) {
    result.error = error.what();
    result.status = "unreadable";
  } catch (const std::bad_alloc&) {
    result.error = path + ": not enough memory";
    result.status = "unreadable";
  }
  return result;
}

Json ToJson(const Result& r, const SolveOptions& options) {
  const bool read = r.error.empty();
  const auto number = [&](bool known, auto value) { return known ? Json(value) : Json(nullptr); };
  const SolveVerdict& v = r.verdict;
  const bool usable = r.usable();
  Json json;
  json["file"] = r.file;
  json["contacts"] = number(read, r.problem.file.num_contacts());
  json["bodies"] = number(read && r.problem.bodies > 0, r.problem.bodies);
  json["model"] = options.model;
  json["cone"] = options.cone;
  json["tolerance"] = options.tolerance;
  json["status"] = r.status;
  json["method"] = number(read, r.method);
  json["iterations"] = number(read, r.answer.iterations);
  json["seconds"] = number(read, r.seconds);
  json["v_ref"] = number(read, r.problem.v_ref);
  json["natural_map_max"] = number(usable, v.natural_map_max);
  json["natural_map_rms"] = number(usable, v.natural_map_rms);
  json["coulomb_map_max"] = number(usable, v.coulomb_map_max);
  json["coulomb_map_rms"] = number(usable, v.coulomb_map_rms);
  json["siconos_error"] = number(usable, v.siconos_error);
  json["gap"] = number(usable, v.gap);
  json["momentum"] = number(usable, v.momentum);
  json["asymmetry"] = number(read, r.problem.asymmetry);
  if (!read) json["error"] = r.error;
  return json;
}

constexpr const char* kHeader = "{:<38} {:>8} {:>6} {:<6} {:<10} {:>5} {:>10} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n";

std::string Row(const Result& r) {
  std::string name = std::filesystem::path(r.file).filename();
  if (name.size() > 38) name = name.substr(0, 35) + "...";
  const auto shown = [](bool known, double value) { return known ? fmt::format("{:.1e}", value) : std::string("-"); };
  const bool read = r.error.empty(), usable = r.usable();
  return fmt::format(kHeader, name, read ? fmt::to_string(r.problem.file.num_contacts()) : "-",
                     r.problem.bodies > 0 ? fmt::to_string(r.problem.bodies) : "-", read ? r.method : "-", r.status,
                     read ? fmt::to_string(r.answer.iterations) : "-",
                     read ? fmt::format("{:.2f}", 1e3 * r.seconds) : "-", shown(usable, r.verdict.natural_map_rms),
                     shown(usable, r.verdict.natural_map_max), shown(usable, r.verdict.coulomb_map_rms),
                     shown(usable, r.verdict.coulomb_map_max), shown(usable, r.verdict.siconos_error),
                     shown(read, r.problem.asymmetry));
}

void CheckOptions(const SolveOptions& o) {
  const auto require = [](bool good, const char* option, const auto& value, const char* rule) {
    if (!good) throw std::invalid_argument(fmt::format("{} must be {}; got {}", option, rule, value));
  };
  require(o.model == "convex" || o.model == "coulomb", "--model", o.model, "one of convex, coulomb");
  require(o.cone == "circular" || o.cone == "octagon", "--cone", o.cone, "one of circular, octagon");
  require(o.tolerance > 0 && o.tolerance <= 0.1, "--tolerance", o.tolerance, "in (0, 0.1]");
  if (o.threads) require(*o.threads >= 0 && *o.threads <= 1024, "--threads", *o.threads, "from 0 to 1024");
  if (!o.report.empty() && o.report != "-") CheckWritable("--report", o.report);
}

}  // namespace

void AddSolveOptions(CLI::App* command, SolveOptions* o) {
  command->add_option("files", o->files, "problems in FCLIB's HDF5 format")->required()->type_name("FILE");
  command->add_option("--model", o->model, "convex or coulomb (default coulomb)")->type_name("NAME");
  command->add_option("--cone", o->cone, "friction cone: circular or octagon (default circular)")->type_name("NAME");
  command->add_option("--tolerance", o->tolerance, "of the natural map over the fastest approach (default 1e-6)")
      ->type_name("X");
  command->add_option("--threads", o->threads, "0: all cores (default); a dense problem uses one")->type_name("N");
  command->add_option("--report", o->report, "write all numbers as a JSON list; - is the standard output")
      ->type_name("FILE");
  command->footer(
      "Examples:\n"
      "  islet run stack --count 3 --frames 4 --group-bodies 0 --export-fclib problems\n"
      "  islet solve problems/*.hdf5\n"
      "  islet solve problems/*.hdf5 --model convex --cone octagon --report answers.json");
}

bool SolveFiles(const SolveOptions& options) {
  CheckOptions(options);
  parallel::WorkerPool pool(options.threads.value_or(0));
  std::FILE* const table = options.report == "-" ? stderr : stdout;
  Print(table, fmt::format(kHeader, "file", "contacts", "bodies", "method", "status", "steps", "ms", "map rms",
                           "map max", "coulomb", "worst", "siconos", "asymm."));
  Json list = Json::array();
  int solved = 0;
  bool all_read = true;
  const Interrupt interrupt("the file under way");
  for (const std::string& path : options.files) {
    if (Interrupt::Asked()) break;
    const Result result = SolveFile(path, options, &pool);
    if (!result.error.empty()) Print(stderr, "islet: " + result.error + "\n");
    const bool shown = Print(table, Row(result));
    list.push_back(ToJson(result, options));
    solved += result.status == "solved";
    all_read = all_read && result.error.empty();
    if (!shown && options.report.empty()) break;  // nobody would see the others
  }
  Print(table,
        fmt::format(
            "{} of {} solved: {} model, natural map {:g} rms and {:g} at any contact, over the fastest approach\n",
            solved, options.files.size(), options.model, options.tolerance, kWorstContact * options.tolerance));
  if (Interrupt::Obeyed()) Print(table, fmt::format("stopped by interrupt after {} files\n", list.size()));
  if (options.report == "-") Print(stdout, list.dump(2) + "\n");
  if (!options.report.empty() && options.report != "-") WriteWhole(options.report, list.dump(2) + "\n");
  return all_read;
}

}  // namespace islet
