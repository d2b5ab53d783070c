// The program `islet`: arguments in, report out, no physics.
//
//   islet scenes          the scenes, one line each
//   islet run SCENE ...   simulates one, see `islet run --help`
//   islet export SCENE    writes a scene as a file, see `islet export --help`
//   islet check FILE ...  tells whether scene files are right
//   islet solve FILE ...  solves problems that others wrote, see `islet solve --help`
//   islet verify [T...]   runs scenes whose answer is known, see `islet verify --help`
//
// Exit status: 0 the run went to its end (what the solvers could not do is in the report), 1 an output could not be
// written, a problem not be read, or a check failed that must hold, 2 a bad argument: the message names the field and the
// value, and no file has been touched.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>

#include "scenes/file_commands.h"
#include "scenes/run.h"
#include "scenes/scene.h"
#include "scenes/solve.h"
#include "scenes/verify/verify.h"

namespace {

void ListScenes(bool with_expectations) {
  for (const islet::Scene& scene : islet::AllScenes()) {
    const std::string size = fmt::format("{} {}", scene.default_count, scene.counted);
    fmt::print("{:<12} {:<13} {}\n", scene.name, size, scene.summary);
    if (with_expectations) fmt::print("{:<26} expected: {}\n", "", scene.expected);
  }
  if (const std::string samples = islet::SamplesFolder(); !samples.empty())
    fmt::print("Scenes as files, for `islet run FILE.json`: {}\n", samples);
}

int Run(int argc, char** argv) {
  CLI::App app("Contact and friction among thousands of rigid bodies, exactly and fast", "islet");
  app.require_subcommand(1);

  CLI::App* const scenes = app.add_subcommand("scenes", "List the scenes: name, size, what they are");
  bool with_expectations = false;
  scenes->add_flag("--expected", with_expectations, "also tell what a right simulation shows");

  CLI::App* const run = app.add_subcommand("run", "Simulate a scene");
  islet::RunOptions options;
  islet::AddRunOptions(run, &options);
  run->footer(
      "Without --frames or --seconds a scene stops when all is at rest, or at its own time limit.\n"
      "A scene may be a file: `islet run castle.json --probes forces.csv`; `islet export cubejam` shows what one looks "
      "like.");

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

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help
    const std::string problem =
        argc > 1 && app.get_subcommands().empty()
            ? fmt::format("the commands are scenes, run, export, check, solve and verify; got {}", argv[1])
            : error.what();
    fmt::print(stderr, "islet: {}\nSee `islet --help` and `islet run --help`.\n", problem);
    return 2;
  }
  if (scenes->parsed()) ListScenes(with_expectations);
  if (run->parsed()) islet::RunScene(options);
  if (export_scene->parsed()) islet::ExportScene(export_options);
  if (check->parsed() && !islet::CheckSceneFiles(check_options)) return 2;
  if (solve->parsed() && !islet::SolveFiles(solve_options)) return 1;
  if (verify->parsed() && !islet::Verify(verify_options, islet::AllChecks())) return 1;
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc, argv);
  } catch (const std::invalid_argument& error) {
    fmt::print(stderr, "islet: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "islet: {}\n", error.what());
    return 1;
  }
}
