#include "scenes/verify/verify.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "scenes/effort_option.h"
#include "scenes/interrupt.h"
#include "scenes/option_checks.h"
#include "scenes/output_file.h"
#include "scenes/terminal_line.h"
#include "scenes/verify/verify_report.h"
#include "scenes/verify/verify_run.h"

namespace islet {
namespace {

VerifyBase CheckOptions(const VerifyOptions& o) {
  RequireTolerance(o.tolerance);
  RequireThreads(o.threads);
  RequireRange("--group-bodies", o.group_bodies, o.group_bodies >= 0, "at least 0");
  if (!o.report.empty() && o.report != "-") CheckWritable("--report", o.report);
  return {o.tolerance, ParseEffort(o.effort), o.threads.value_or(0), o.group_bodies, o.quick};
}

void ListChecks(std::span<const Check* const> checks) {
  std::string list;
  for (const Check* const check : checks)
    list += fmt::format("{:<4} {}  {}\n         {}\n", check->id, NameOf(check->gate), check->name, check->reference);
  Print(stdout, list);
}

// On a terminal, which of how many runs is going on.
VerifyProgress ProgressIn(TerminalLine* line, size_t done_before, size_t total) {
  return [=](const Check& check, const Setting& setting, int done) {
    line->Show(fmt::format("{} of {}: {} {}, dt {}, {}, freezing {}", done_before + done + 1, total, check.id,
                           check.name, setting.dt.name, setting.model, setting.freeze));
  };
}

void PrintSummary(std::FILE* out, std::span<const VerifyRow> rows, size_t num_checks) {
  int coulomb = 0, passed = 0;
  for (const VerifyRow& row : rows) {
    const bool counts = row.setting->settings.engine.model == Model::kCoulomb;
    coulomb += counts;
    passed += counts && row.Pass();
  }
  if (coulomb == 0) {
    Print(out, fmt::format("{} checks; no gates: these hold for the model coulomb alone\n", num_checks));
    return;
  }
  const int failed = CountFailedGates(rows);
  const auto open = std::count_if(rows.begin(), rows.end(), [](const VerifyRow& row) {
    return row.measurement.open && !row.Pass() && row.setting->settings.engine.model == Model::kCoulomb;
  });
  Print(out,
        fmt::format("{} checks; under exact Coulomb friction {} of {} measurements within their bounds, {} open; {}\n",
                    num_checks, passed, coulomb, open,
                    failed == 0 ? "no gate failed" : fmt::format("{} gate{} FAILED", failed, failed == 1 ? "" : "s")));
}

}  // namespace

void AddVerifyOptions(CLI::App* command, VerifyOptions* o) {
  command->add_option("checks", o->ids, "which, as T1 T14 (default: all)")->type_name("T");
  const auto add = [&](const char* name, auto& target, const char* type, const char* help) {
    return command->add_option(name, target, help)->type_name(type);
  };
  add("--dt", o->dt, "LIST", "time steps [s], numbers or fractions (default 1/60,1/240)");
  add("--model", o->model, "LIST",
      "of coulomb (default), convex, kinetic, paper: all as in the paper, its freezing too");
  add("--freeze", o->freeze, "LIST", "of off, certified (default: both)");
  add("--tolerance", o->tolerance, "X", "of the contact problems, in [1e-15, 0.1] (default 1e-6)");
  add("--effort", o->effort, "NAME|N", kEffortHelp);
  command->add_option_function<std::string>("--tier", NoteTier)->group("");  // hidden
  add("--group-bodies", o->group_bodies, "N",
      "groups of up to so many bodies move by the law of the step (default 20; 0: none)");
  add("--threads", o->threads, "N", "0: all cores (default)");
  add("--gate", o->gate, "LIST", "only checks of G1, G2 (must hold) or G3 (statistics)");
  command->add_flag("--quick", o->quick, "leave out the largest sizes and the longest times");
  command->add_flag("--all", o->all_settings, "a row for every setting, not only for the worst one");
  command->add_flag("--list", o->list, "tell the checks and where their references come from, and run none");
  add("--report", o->report, "FILE|-", "write all measurements as a JSON list; - is the standard output")
      ->check(FileOrDash);
  command->footer(
      "Examples:\n"
      "  islet verify --list\n"
      "  islet verify T1 T3 --quick\n"
      "  islet verify T1 --quick --dt 1/60,0.004 --model coulomb,convex --all --report -");
}

bool Verify(const VerifyOptions& options, std::span<const Check> checks) {
  const VerifyBase base = CheckOptions(options);
  const std::vector<Setting> settings = CrossSettings(options.dt, options.model, options.freeze, base);
  const std::vector<const Check*> selected = SelectChecks(checks, options.ids, options.gate);
  if (options.list) {
    ListChecks(selected);
    return true;
  }
  std::FILE* const table = options.report == "-" ? stderr : stdout;
  const Interrupt interrupt("ends after the run under way");
  Print(table, VerifyHeader(settings, options.all_settings));
  std::vector<VerifyRow> rows;
  TerminalLine line;
  size_t num_checks = 0;  // begun
  for (size_t k = 0; k < selected.size() && !Interrupt::Asked(); ++k) {
    const std::vector<VerifyRow> of_check =
        RunCheck(*selected[k], settings, ProgressIn(&line, k * settings.size(), selected.size() * settings.size()));
    line.Clear();
    const bool shown = Print(table, VerifyTable(of_check, settings, options.all_settings));
    rows.insert(rows.end(), of_check.begin(), of_check.end());
    ++num_checks;
    if (!shown && options.report.empty()) break;  // nobody would see the others
  }
  PrintSummary(table, rows, num_checks);
  if (Interrupt::Obeyed())
    Print(table, fmt::format("stopped by interrupt: of {} checks {} begun, the last perhaps not in every setting\n",
                             selected.size(), num_checks));
  if (options.report == "-") Print(stdout, VerifyJson(rows, options.tolerance));
  if (!options.report.empty() && options.report != "-") WriteWhole(options.report, VerifyJson(rows, options.tolerance));
  return CountFailedGates(rows) == 0;
}

}  // namespace islet
