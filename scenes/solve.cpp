#include "scenes/solve.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "engine/stopwatch.h"
#include "parallel/worker_pool.h"
#include "scenes/apart.h"
#include "scenes/interrupt.h"
#include "scenes/option_checks.h"
#include "scenes/output_file.h"
#include "scenes/printable.h"
#include "scenes/solve_judge.h"
#include "scenes/solve_problem.h"
#include "scenes/terminal_line.h"

namespace islet {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kWorstContact = 10;  // times the tolerance: the largest natural map of a contact in a solved problem

struct Result {
  std::string file, error;  // error: why it could not be read or solved at all
  std::optional<int> contacts;
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
  const bool sparse = result->problem.rigid.has_value(), fits = FitsDense(result->problem),
             circular = law.cone == qp::Cone::kCircular;
  if (sparse) attempt(true);
  if (fits && circular && !(sparse && Solved(result->verdict, options.tolerance))) {
    try {
      attempt(false);
    } catch (const FclibError&) {
      if (!sparse) throw;  // else there is an answer, and the table tells how good it is
    }
  }
  if (result->method.empty() && !circular)
    throw FclibError(result->file +
                     ": --cone octagon is for problems of rigid bodies (M of blocks of 6 x 6, two bodies a contact)");
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

// tell: gets the number of contacts as soon as it is known.
Result SolveFile(const std::string& path, const SolveOptions& options, const Tell& tell) {
  Result result;
  result.file = path;
  try {
    const FclibProblem original = ReadFclib(path);
    result.problem = PrepareProblem(path, original);
    result.contacts = result.problem.file.num_contacts();
    tell(fmt::to_string(*result.contacts));
    parallel::WorkerPool pool(options.threads.value_or(0));
    pool.ForEach(1, [&](int, int) { SolveAndJudge(original, options, &result); });
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
  json["contacts"] = number(r.contacts.has_value(), r.contacts.value_or(0));
  json["bodies"] = number(read && !r.problem.touched.empty(), r.problem.touched.size());
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
  return fmt::format(kHeader, name, r.contacts ? fmt::to_string(*r.contacts) : "-",
                     r.problem.touched.empty() ? "-" : fmt::to_string(r.problem.touched.size()), read ? r.method : "-",
                     r.status, read ? fmt::to_string(r.answer.iterations) : "-",
                     read ? fmt::format("{:.2f}", 1e3 * r.seconds) : "-", shown(usable, r.verdict.natural_map_rms),
                     shown(usable, r.verdict.natural_map_max), shown(usable, r.verdict.coulomb_map_rms),
                     shown(usable, r.verdict.coulomb_map_max), shown(usable, r.verdict.siconos_error),
                     shown(read, r.problem.asymmetry));
}

// What a file came to: a row of the table, an entry of the report.
struct Entry {
  std::string status, row, error;
  Json json;
};

Entry EntryOf(const Result& result, const SolveOptions& options) {
  return {result.status, Row(result), result.error, ToJson(result, options)};
}

// On a terminal in one line, elsewhere once a file and then every ten seconds.
class FileProgress {
 public:
  FileProgress(TerminalLine* line, const std::string& path, size_t number, size_t count)
      : line_(line), title_(fmt::format("file {} of {}: {}", number, count, path)) {
    if (!line_->on_terminal()) Print(stderr, title_ + "\n");
  }
  void Show(double seconds, const std::string& contacts) {
    const std::string counted = contacts.empty() ? "reading" : contacts + " contacts";
    line_->Show(fmt::format("{}, {}, {:.1f} s", title_, counted, seconds));
    if (line_->on_terminal() || seconds < next_) return;
    Print(stderr, fmt::format("{}, {}, {:.0f} s\n", title_, counted, seconds));
    next_ += kSeldom;
  }

 private:
  static constexpr double kSeldom = 10;  // [s]
  TerminalLine* line_;
  std::string title_;
  double next_ = kSeldom;
};

// In a process of its own. Nothing if an interrupt ended it.
std::optional<Entry> SolveApart(const std::string& path, const SolveOptions& options, FileProgress* progress) {
  constexpr auto kMend = Json::error_handler_t::replace;  // names of files are any bytes
  const auto work = [&](const Tell& tell) {
    const Entry entry = EntryOf(SolveFile(path, options, tell), options);
    return Json{entry.status, entry.row, entry.error, entry.json}.dump(-1, ' ', false, kMend);
  };
  const ApartEnd end = RunApart(work, options.time_limit, [&](double seconds, const std::string& contacts) {
    progress->Show(seconds, contacts);
  });
  if (end.how == ApartEnd::How::kInterrupt) return std::nullopt;
  if (end.how == ApartEnd::How::kDone) {
    const Json text = Json::parse(end.text);
    return Entry{text[0], text[1], text[2], text[3]};
  }
  Result given_up;
  given_up.file = path;
  if (!end.told.empty()) given_up.contacts = std::stoi(end.told);
  const bool late = end.how == ApartEnd::How::kTimeLimit;
  given_up.status = late ? "time limit" : "unreadable";
  given_up.error = late ? fmt::format("{}: {} within --time-limit {} s", path,
                                      given_up.contacts ? "not solved" : "not read", *options.time_limit)
                        : fmt::format("{}: the work on it broke down: {}", path, end.text);
  return EntryOf(given_up, options);
}

void CheckOptions(const SolveOptions& o) {
  RequireRange("--model", o.model, o.model == "convex" || o.model == "coulomb", "one of convex, coulomb");
  RequireRange("--cone", o.cone, o.cone == "circular" || o.cone == "octagon", "one of circular, octagon");
  RequireTolerance(o.tolerance);
  RequireThreads(o.threads);
  RequireTime("--time-limit", o.time_limit);
  if (o.report.empty() || o.report == "-") return;
  for (const std::string& file : o.files)
    if (SameOutput(o.report, file)) throw std::invalid_argument("--report would overwrite " + file);
  CheckWritable("--report", o.report);
}

}  // namespace

void AddSolveOptions(CLI::App* command, SolveOptions* o) {
  command->add_option("files", o->files, "problems in FCLIB's HDF5 format")->required()->type_name("FILE");
  command->add_option("--model", o->model, "convex or coulomb (default coulomb)")->type_name("NAME");
  command->add_option("--cone", o->cone, "friction cone: circular or octagon (default circular)")->type_name("NAME");
  command->add_option("--tolerance", o->tolerance, "of the natural map over the fastest approach (default 1e-6)")
      ->type_name("X");
  command->add_option("--threads", o->threads, "0: all cores (default); a dense problem uses one")->type_name("N");
  AddTime(command, "--time-limit", &o->time_limit,
          "give a problem up after S seconds, its reading included (default: none)");
  command->add_flag("--strict", o->strict, "exit status 3 if a problem is not solved");
  command->add_option("--report", o->report, "write all numbers as a JSON list; - is the standard output")
      ->type_name("FILE")
      ->check(FileOrDash);
  command->footer(
      "Examples:\n"
      "  islet run stack --count 3 --frames 4 --group-bodies 0 --export-fclib problems\n"
      "  islet solve problems/*.hdf5\n"
      "  islet solve problems/*.hdf5 --model convex --cone octagon --report answers.json");
}

SolveEnd SolveFiles(const SolveOptions& options) {
  CheckOptions(options);
  std::FILE* const table = options.report == "-" ? stderr : stdout;
  Print(table, fmt::format(kHeader, "file", "contacts", "bodies", "method", "status", "steps", "ms", "map rms",
                           "map max", "coulomb", "worst", "siconos", "asymm."));
  Json list = Json::array();
  int solved = 0;
  bool all_read = true;
  const Interrupt interrupt("what has been solved is reported");
  TerminalLine line;
  for (size_t k = 0; k < options.files.size(); ++k) {
    FileProgress progress(&line, options.files[k], k + 1, options.files.size());
    const std::optional<Entry> entry = SolveApart(options.files[k], options, &progress);
    line.Clear();
    if (!entry) break;
    if (!entry->error.empty()) Print(stderr, "islet: " + Printable(entry->error) + "\n");
    const bool shown = Print(table, entry->row);
    list.push_back(entry->json);
    solved += entry->status == "solved";
    all_read = all_read && entry->status != "unreadable" && !entry->json["contacts"].is_null();
    if (!shown && options.report.empty()) break;  // nobody would see the others
  }
  Print(table,
        fmt::format(
            "{} of {} solved: {} model, natural map {:g} rms and {:g} at any contact, over the fastest approach\n",
            solved, list.size(), options.model, options.tolerance, kWorstContact * options.tolerance));
  if (Interrupt::Obeyed())
    Print(table, fmt::format("stopped by interrupt after {} of {} files\n", list.size(), options.files.size()));
  if (options.report == "-") Print(stdout, list.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  if (!options.report.empty() && options.report != "-")
    WriteWhole(options.report, list.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  if (!all_read) return SolveEnd::kNotRead;
  return solved == static_cast<int>(list.size()) ? SolveEnd::kSolved : SolveEnd::kNotSolved;
}

}  // namespace islet
