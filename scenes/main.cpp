// The program `islet`: arguments in, report out, no physics.
//
//   islet scenes          the scenes, one line each
//   islet run SCENE ...   simulates one, see `islet run --help`
//   islet view SCENE ...  the same as a page for a browser, see `islet view --help`
//   islet replay FILE     what a run recorded, see `islet replay --help`
//   islet export SCENE    writes a scene as a file, see `islet export --help`
//   islet check FILE ...  tells whether scene files are right
//   islet solve FILE ...  solves problems that others wrote, see `islet solve --help`
//   islet verify [T...]   runs scenes whose answer is known, see `islet verify --help`
//   islet completion S    what lets the shell S complete all this
//   islet man             this, as a manual page
//   islet --version       tells its version, and what it is made of
//
// Exit status: 0 the run went to its end (what the solvers could not do is in the report; failed steps are told on the
// standard error), 1 an output, the standard output among them, could not be written, a problem not be read, or a check
// failed that must hold, 2 a bad argument: the message names the field and the value, and no file has been touched, 3 with
// --strict a step failed or a problem is not solved: all has been written, 130 interrupted: what was done has been written.
#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "scenes/about.h"
#include "scenes/completion.h"
#include "scenes/file_commands.h"
#include "scenes/interrupt.h"
#include "scenes/manual.h"
#include "scenes/option_checks.h"
#include "scenes/output_file.h"
#include "scenes/printable.h"
#include "scenes/replay.h"
#include "scenes/run.h"
#include "scenes/scene.h"
#include "scenes/solve.h"
#include "scenes/verify/verify.h"
#include "scenes/view.h"

namespace {

constexpr int kStrictStatus = 3;

void ListScenes(bool with_expectations) {
  std::string list;
  for (const islet::Scene& scene : islet::AllScenes()) {
    const std::string size = fmt::format("{} {}", scene.default_count, scene.counted);
    list += fmt::format("{:<12} {:<13} {}\n", scene.name, size, scene.summary);
    if (with_expectations) list += fmt::format("{:<26} expected: {}\n", "", scene.expected);
  }
  if (const std::string samples = islet::SamplesFolder(); !samples.empty())
    list += fmt::format("Scenes as files, for `islet run FILE.json`: {}\n", samples);
  islet::Print(stdout, list);
}

std::string CommandNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* const command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return fmt::format("{}", fmt::join(names, ", "));
}

// What may stand where a command takes a name.
islet::ArgumentWords Words() {
  islet::ArgumentWords words{{"shell", {"bash", "zsh", "fish"}}};
  for (const islet::Scene& scene : islet::AllScenes()) words["scene"].emplace_back(scene.name);
  for (const islet::Check& check : islet::AllChecks()) words["checks"].emplace_back(check.id);
  return words;
}

int Run(int argc, char** argv) {
  CLI::App app("Contact and friction among thousands of rigid bodies, exactly and fast", "islet");
  app.require_subcommand(1);
  app.set_version_flag("--version", islet::About, "Tell the version, and those of the libraries in it");
  app.footer(
      "Exit status: 0 done; 1 an output could not be written, a problem not be read, or a check failed that must "
      "hold;\n"
      "2 a bad argument; 3 with --strict: a step failed, or a problem is not solved; 130 interrupted.\n"
      "The first Ctrl-C (or SIGTERM) ends run, view, replay --check, solve and verify in order: what is done is "
      "written\n"
      "and reported. The second one ends them at once.");

  CLI::App* const scenes = app.add_subcommand("scenes", "List the scenes: name, size, what they are");
  bool with_expectations = false;
  scenes->add_flag("--expected", with_expectations, "also tell what a right simulation shows");
  scenes->footer("Examples:\n  islet scenes\n  islet scenes --expected");

  CLI::App* const run = app.add_subcommand("run", "Simulate a scene");
  islet::RunOptions options;
  islet::AddRunOptions(run, &options);

  CLI::App* const view = app.add_subcommand("view", "Simulate a scene and write a page that shows it in a browser");
  islet::RunOptions view_options;
  islet::AddViewOptions(view, &view_options);
  view->footer(
      "The page is one file and needs no network. Open it in any browser. With --live it runs until Ctrl-C, and the\n"
      "page, whose address is told, pauses and steps it, throws balls, drags bodies, changes gravity and friction.\n\n"
      "Examples:\n"
      "  islet view csstack --seconds 1/2 --out csstack.html\n"
      "  islet view cubejam --count 20 --frames 20\n"
      "  islet view cubejam --count 20 --live");
  CLI::App* const replay = app.add_subcommand("replay", "Tell, check or convert what `islet run --record` kept");
  islet::ReplayOptions replay_options;
  islet::AddReplayOptions(replay, &replay_options);

  CLI::App* const export_scene = app.add_subcommand("export", "Write a scene as a file that `islet run` reads");
  islet::ExportOptions export_options;
  islet::AddExportOptions(export_scene, &export_options);

  CLI::App* const check = app.add_subcommand("check", "Tell whether scene files are right, without running them");
  islet::CheckFilesOptions check_options;
  islet::AddCheckFilesOptions(check, &check_options);

  CLI::App* const solve = app.add_subcommand("solve", "Solve frictional contact problems in FCLIB's HDF5 format");
  islet::SolveOptions solve_options;
  islet::AddSolveOptions(solve, &solve_options);

  CLI::App* const verify = app.add_subcommand("verify", "Run scenes whose answer is known, and tell how far off it is");
  islet::VerifyOptions verify_options;
  islet::AddVerifyOptions(verify, &verify_options);

  CLI::App* const completion =
      app.add_subcommand("completion", "Print what lets a shell complete this program's command line");
  std::string shell;
  completion->add_option("shell", shell, "bash, zsh or fish")->required()->type_name("SHELL");
  completion->footer("Examples:\n  islet completion bash > islet.bash\n  islet completion zsh");

  CLI::App* const manual = app.add_subcommand("man", "Print this program's manual page");
  manual->footer("Examples:\n  islet man > islet.1");

  for (CLI::App* const command : app.get_subcommands([](const CLI::App*) { return true; }))
    islet::ReadDecimals(command);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help, --version
      std::ostringstream text;
      app.exit(error, text);
      islet::Print(stdout, text.str());
      return 0;
    }
    const std::string problem = argc > 1 && app.get_subcommands().empty()
                                    ? fmt::format("the commands are {}; got {}", CommandNames(app), argv[1])
                                    : error.what();
    const std::vector<CLI::App*> meant = app.get_subcommands();
    const std::string of_command = meant.empty() ? "" : fmt::format(" and `islet {} --help`", meant[0]->get_name());
    islet::Print(stderr, fmt::format("islet: {}\nSee `islet --help`{}.\n", problem, of_command));
    return 2;
  }
  if (scenes->parsed()) ListScenes(with_expectations);
  bool good = true, strictly_failed = false;
  if (run->parsed()) {
    options.arguments = islet::RunArguments(*run);
    strictly_failed = islet::RunScene(options).failed_steps > 0 && options.strict;
  }
  if (view->parsed()) {
    view_options.arguments = islet::RunArguments(*view);
    islet::View(view_options);
  }
  if (replay->parsed()) islet::Replay(replay_options);
  if (export_scene->parsed()) islet::ExportScene(export_options);
  if (check->parsed() && !islet::CheckSceneFiles(check_options)) return 2;
  if (solve->parsed()) {
    const islet::SolveEnd end = islet::SolveFiles(solve_options);
    good = end != islet::SolveEnd::kNotRead;
    strictly_failed = end == islet::SolveEnd::kNotSolved && solve_options.strict;
  }
  if (verify->parsed()) good = islet::Verify(verify_options, islet::AllChecks());
  if (completion->parsed()) islet::Print(stdout, islet::Completion(app, shell, Words()));
  if (manual->parsed()) islet::Print(stdout, islet::Manual(app, islet::Version()));
  if (islet::Interrupt::Obeyed()) return islet::Interrupt::kExitStatus;
  if (strictly_failed) return kStrictStatus;
  return good ? 0 : 1;
}

// Line by line. What it quotes is not ours.
void Tell(const std::exception& error) {
  std::istringstream lines(error.what());
  for (std::string line; std::getline(lines, line);)
    islet::Print(stderr, fmt::format("islet: {}\n", islet::Printable(line)));
}

// What nobody opened stays closed to us, but its number is taken: a file of ours would get it, and what is printed would go into that.
void TakeStandardStreams() {
  for (int file = 0; file <= 2; ++file)
    if (::fcntl(file, F_GETFD) < 0)
      ::open("/dev/null", file == 0 ? O_WRONLY : O_RDONLY);  // the lowest number that is free
}

}  // namespace

int main(int argc, char** argv) {
  TakeStandardStreams();
  std::signal(SIGPIPE, SIG_IGN);  // who reads no more of what is printed does not cost the files
  try {
    const int status = Run(argc, argv);
    islet::FinishStandardOutput();
    return status;
  } catch (const std::invalid_argument& error) {
    Tell(error);
    return 2;
  } catch (const std::exception& error) {
    Tell(error);
    return 1;
  }
}
