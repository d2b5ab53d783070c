#include "scenes/file_commands.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <system_error>

#include "scenes/file/drives.h"
#include "scenes/file/probes.h"
#include "scenes/file/scene_reader.h"
#include "scenes/file/scene_writer.h"
#include "scenes/option_checks.h"
#include "scenes/output_file.h"
#include "scenes/printable.h"
#include "scenes/ready_scene.h"
#include "scenes/run_options.h"
#include "scenes/run_report.h"

namespace islet {
namespace {

// What a reader would refuse is not written.
void RequireReadable(const std::string& scene, const std::string& text) {
  const std::string problem = scene + " with that many bodies is too large for a scene file: ";
  if (text.size() > kMostFileBytes)
    throw std::invalid_argument(fmt::format("{}{} bytes, at most {} are read", problem, text.size(), kMostFileBytes));
  try {
    JsonTree tree(text);
  } catch (const JsonError& error) {
    throw std::invalid_argument(problem + error.path + " " + error.what());
  }
}

std::string CheckedLine(const std::string& file) {
  const SceneDescription description = ReadScene(std::make_shared<const Document>(file, ReadSceneText(file)));
  Settings settings = description.settings;
  settings.threads = 1;
  const MadeScene made = MakeScene(description, settings, description.seed);
  const Drives drives(description, made);
  const Probes probes(description, made);
  return fmt::format("{}: good: {}, {}, {} of them dynamic\n", Printable(file),
                     description.title.empty() ? "no title" : Printable(description.title),
                     CountedBodies(static_cast<int>(made.world.bodies().size())), made.info.bodies);
}

}  // namespace

void AddExportOptions(CLI::App* command, ExportOptions* options) {
  command->add_option("scene", options->scene, "name of a built-in scene, see `islet scenes`")
      ->required()
      ->type_name("SCENE");
  AddSceneParameters(command, &options->parameters);
  command->add_option("--out", options->out, "where to write it (default: the standard output)")
      ->group("Output")
      ->type_name("FILE")
      ->check([](const std::string& name) {
        return name == "-" ? "without it the file goes to the standard output; got -" : FileOrDash(name);
      });
  command->footer(
      "The file runs to the same state hash as the scene. The format is told in scenes/README.md.\n\n"
      "Examples:\n"
      "  islet export cubejam --count 20 --out jam.json\n"
      "  islet run jam.json --frames 10");
}

void ExportScene(const ExportOptions& options) {
  if (IsSceneFile(options.scene))
    throw std::invalid_argument("scene: built-in ones are exported, files are not; got " + options.scene);
  const Scene& scene = RequireScene(options.scene);
  if (!options.out.empty()) CheckWritable("--out", options.out);
  Settings settings;
  settings.threads = 1;
  const BuiltScene built = BuildScene(scene, options.parameters, settings);
  SceneCaption caption;
  caption.title = fmt::format("{}: {}", scene.name, scene.summary);
  caption.about = fmt::format("The built-in scene {}, as `islet export` wrote it.", scene.name);
  caption.expected = scene.expected;
  caption.seed = built.info.seed;
  caption.end = scene.time_limit;
  caption.bounds = built.info.bounds;
  caption.passed_z = built.info.passed_z;
  const std::string text = WriteScene(built.world, caption);
  RequireReadable(options.scene, text);
  if (!options.out.empty()) return WriteWhole(options.out, text);
  Print(stdout, text);
}

void AddCheckFilesOptions(CLI::App* command, CheckFilesOptions* options) {
  command->add_option("files", options->files, "scene files")->required()->type_name("FILE...");
  command->footer(
      "What is wrong is told with file, line, column, path and value.\n"
      "Exit status: 0 all are right, 2 some are not.\n\n"
      "Examples:\n"
      "  islet export stack --count 3 --out tower.json\n"
      "  islet check tower.json");
}

bool CheckSceneFiles(const CheckFilesOptions& options) {
  bool good = true;
  for (const std::string& file : options.files) {
    try {
      Print(stdout, CheckedLine(file));
    } catch (const std::exception& error) {
      Print(stderr, fmt::format("islet: {}\n", Printable(error.what())));
      good = false;
    }
  }
  return good;
}

std::string SamplesFolder() {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (error) return "";
  const fs::path folder = program.parent_path();
  for (const fs::path& candidate : {folder / "../share/islet/samples", folder / "../../../scenes/samples"})
    if (fs::is_directory(candidate, error)) return fs::weakly_canonical(candidate, error).string();
  return "";
}

}  // namespace islet
