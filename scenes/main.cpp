// The program `islet`: arguments in, report out, no physics.
//
//   islet scenes          the scenes, one line each
//   islet run SCENE ...   simulates one, see `islet run --help`
//
// Exit status: 0 the run went to its end (what the solvers could not do is in the report), 1 an output could not be
// written, 2 a bad argument: the message names the field and the value, and no file has been touched.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>

#include "scenes/run.h"
#include "scenes/scene.h"

namespace {

void ListScenes(bool with_expectations) {
  for (const islet::Scene& scene : islet::AllScenes()) {
    const std::string size = fmt::format("{} {}", scene.default_count, scene.counted);
    fmt::print("{:<12} {:<13} {}\n", scene.name, size, scene.summary);
    if (with_expectations) fmt::print("{:<26} expected: {}\n", "", scene.expected);
  }
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
  run->footer("Without --frames or --seconds a scene stops when all is at rest, or at its own time limit.");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help
    const std::string problem = argc > 1 && app.get_subcommands().empty()
                                    ? fmt::format("the commands are scenes and run; got {}", argv[1])
                                    : error.what();
    fmt::print(stderr, "islet: {}\nSee `islet --help` and `islet run --help`.\n", problem);
    return 2;
  }
  if (scenes->parsed()) ListScenes(with_expectations);
  if (run->parsed()) islet::RunScene(options);
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
