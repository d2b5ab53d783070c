#include "scenes/run_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <limits>
#include <stdexcept>
#include <thread>
#include <utility>

#include "scenes/effort_option.h"
#include "scenes/export_fclib.h"
#include "scenes/option_checks.h"
#include "scenes/output_file.h"
#include "scenes/setting_names.h"

namespace islet {
namespace {

template <typename T, size_t n>
T Choose(const char* option, const std::string& value, const std::array<std::pair<const char*, T>, n>& choices) {
  if (const std::optional<T> choice = ValueIn(choices, value)) return *choice;
  std::string names;
  for (const auto& [name, choice] : choices) names += (names.empty() ? "" : ", ") + std::string(name);
  throw std::invalid_argument(fmt::format("{} must be one of {}; got {}", option, names, value));
}

// off, auto, or names of rungs that a study wants to have alone.
Ladder ParseLadder(const std::string& text) {
  if (text == "auto") return {};
  Ladder ladder = Ladder::Off();
  if (text == "off") return ladder;
  for (size_t begin = 0, end; begin <= text.size(); begin = end + 1) {
    end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    const auto known = std::find(std::begin(qp::kRungNames), std::end(qp::kRungNames), name);
    if (known == std::end(qp::kRungNames))
      throw std::invalid_argument(fmt::format("--ladder must be off, auto or some of {}; got {}",
                                              fmt::join(qp::kRungNames, ","),
                                              name.empty() ? fmt::format("an empty name in '{}'", text) : name));
    ladder = ladder.With(static_cast<qp::Rung>(known - std::begin(qp::kRungNames)));
  }
  return ladder;
}

int ParseBounceLimit(const std::string& text) {
  if (text == "auto") return kAutoBounceLimit;
  int value = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) {
    throw std::invalid_argument(fmt::format("--bounce-limit must be auto or a whole number >= 0; got {}", text));
  }
  return value;
}

// The library would read a negative number as a huge one, and one that is too large as the largest.
std::string WholeNumber(const std::string& text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool good = error == std::errc() && end == text.data() + text.size();
  return good ? "" : "must be a whole number from 0 to 2^64 - 1; got " + text;
}

std::string FileName(const std::string& text) {
  return text == "-" ? "must be the name of a file, only --report takes the standard output; got -" : FileOrDash(text);
}

bool EndsIn(std::string_view name, std::string_view ending) {
  return name.size() >= ending.size() && std::equal(ending.rbegin(), ending.rend(), name.rbegin(), [](char a, char b) {
           return a == std::tolower(static_cast<unsigned char>(b));
         });
}

std::string PictureName(const std::string& text) {
  return EndsIn(text, ".svg") || EndsIn(text, ".png") ? "" : "must end in .svg or .png; got " + text;
}

std::string PageName(const std::string& text) { return EndsIn(text, ".html") ? "" : "must end in .html; got " + text; }

void CheckNumbers(const RunOptions& o) {
  if (o.dt) RequireRange("--dt", *o.dt, *o.dt > 0 && *o.dt <= 1 && *o.dt >= 1e-9, "in [1e-9, 1] s");
  if (o.frames) RequireRange("--frames", *o.frames, *o.frames >= 1, "at least 1");
  RequireTime("--seconds", o.seconds);
  RequireThreads(o.threads);
  if (o.tolerance) RequireTolerance(*o.tolerance);
  if (o.freeze_count) RequireRange("--freeze-count", *o.freeze_count, *o.freeze_count >= 0, "at least 0");
  if (o.group_bodies) RequireRange("--group-bodies", *o.group_bodies, *o.group_bodies >= 0, "at least 0");
  for (const int frame : o.export_frames) RequireRange("--export-frames", frame, frame >= 1, "at least 1");
  if (o.picture_frame) RequireRange("--picture-frame", *o.picture_frame, *o.picture_frame >= 0, "at least 0");
  if (o.picture_time) {
    RequireRange("--picture-time", *o.picture_time, *o.picture_time >= 0 && *o.picture_time <= kLongestRun,
                 "in [0, 1e6] s");
  }
}

void CheckFiles(const RunOptions& o) {
  const auto outputs = Outputs(o);
  for (auto output = outputs.begin(); output != outputs.end(); ++output) {
    const std::string& file = output->second;
    CheckWritable(output->first, file);
    if (std::any_of(outputs.begin(), output, [&](const auto& before) { return SameOutput(before.second, file); }))
      throw std::invalid_argument("two outputs go to the same file " + file);
  }
  if (o.picture_time && o.picture.empty()) {
    throw std::invalid_argument(fmt::format("--picture-time {} needs --picture FILE", *o.picture_time));
  }
  if (o.picture_frame && o.picture.empty()) {
    throw std::invalid_argument(fmt::format("--picture-frame {} needs --picture FILE", *o.picture_frame));
  }
  if (!o.export_frames.empty() && o.export_fclib.empty()) {
    throw std::invalid_argument(fmt::format("--export-frames {} needs --export-fclib DIR", o.export_frames[0]));
  }
  if (!o.export_fclib.empty()) FclibExport::CheckFolder("--export-fclib", o.export_fclib);
}

const char* const kOutput = "Output";

// Whether two runs that differ in this may differ in their answers.
bool Decides(const CLI::Option& option) {
  return option.get_group() != kOutput && !option.get_group().empty() && !option.check_name("--threads") &&
         !option.check_name("--help");
}

// What chooses scene, time and method.
void AddSceneOptions(CLI::App* command, RunOptions* options) {
  RunOptions& o = *options;
  command->add_option("scene", o.scene, "name of a scene, see `islet scenes`, or a scene file: what/ever.json")
      ->required()
      ->type_name("SCENE");

  const auto add = [&](const char* group, const char* name, auto& target, const char* type, const std::string& help) {
    return command->add_option(name, target, help)->group(group)->type_name(type);
  };
  AddSceneParameters(command, &o.parameters);
  const char* const kTime = "Time";
  CLI::Option* const frames = add(kTime, "--frames", o.frames, "N", "stop after N frames");
  AddTime(command, "--seconds", &o.seconds, "stop after S seconds of simulated time, as 2.5 or 1/3")
      ->group(kTime)
      ->excludes(frames);
  AddTime(command, "--dt", &o.dt, "time step, at most 1 s, as 0.01 or 1/60 (default 1/30, or the scene file's)")
      ->group(kTime);

  const char* const kMethod = "The method";
  add(kMethod, "--model", o.model, "NAME", "kinetic, convex or coulomb (default coulomb)");
  add(kMethod, "--cone", o.cone, "NAME", "friction cone: circular or octagon (default circular)");
  add(kMethod, "--ladder", o.ladder, "off|auto|RUNG,...",
      fmt::format("cheaper ways to the same answer, tried first: {}; off: all to the interior point (default auto)",
                  fmt::join(qp::kRungNames, ", ")));
  add(kMethod, "--effort", o.effort, "NAME|N", kEffortHelp);
  command->add_option_function<std::string>("--tier", NoteTier)->group("");  // hidden
  add(kMethod, "--tolerance", o.tolerance, "X", "of the contact problems, in [1e-15, 0.1] (default 1e-6)");
  add(kMethod, "--bounce", o.bounce, "NAME", "bounce law of the priority queue: eq5, eq6 or exact (default exact)");
  add(kMethod, "--bounce-limit", o.bounce_limit, "N|auto",
      "bounces per island before the QP takes over (default auto)");
  add(kMethod, "--freeze", o.freeze, "NAME", "off, paper or certified (default certified)");
  add(kMethod, "--group-bodies", o.group_bodies, "N",
      "groups of up to so many bodies move by the law of the step (default 20; 0: none)");
  add(kMethod, "--freeze-count", o.freeze_count, "N",
      "paper freezing: frames at low energy before a body freezes (default 3)");
  command
      ->add_flag("--paper", o.paper, "as in the paper: kinetic, octagon, eq5, paper freezing; other options override")
      ->group(kMethod);
  add(kMethod, "--threads", o.threads, "N", "0: all cores (default)");
}

}  // namespace

void AddSceneParameters(CLI::App* command, SceneParameters* parameters) {
  SceneParameters& p = *parameters;
  const auto add = [&](const char* name, auto& target, const char* type, const char* help) {
    return command->add_option(name, target, help)->group("The scene")->type_name(type);
  };
  add("--count", p.count, "N", "how many pieces (default: the scene's own number)");
  add("--seed", p.seed, "K", "of the random placement")->check(WholeNumber);
  add("--friction", p.friction, "MU", "of all bodies, >= 0 (default 0.5 in most scenes)");
  add("--restitution", p.restitution, "E", "of all bodies, in [0, 1] (default 0.2 in most scenes)");
  add("--drop", p.drop, "H", "stack, csstack, manystacks: gap [m] below each body at the start (default 0)");
  add("--angle", p.angle, "RAD", "balance: the upper sphere's angle off the vertical (default 0.01)");
  add("--incoming", p.incoming, "K", "officetoy: number of spheres that fly in (default 1)");
}

std::vector<std::pair<const char*, std::string>> Outputs(const RunOptions& o) {
  std::vector<std::pair<const char*, std::string>> outputs{{"--report", o.ReportOnStdout() ? "" : o.report},
                                                           {"--frames-csv", o.frames_csv},
                                                           {"--trace", o.trace},
                                                           {"--probes", o.probes},
                                                           {"--picture", o.picture},
                                                           {"--record", o.record},
                                                           {o.html_plays ? "--out" : "--html", o.html}};
  std::erase_if(outputs, [](const auto& output) { return output.second.empty(); });
  return outputs;
}

bool IsPng(const std::string& picture) { return EndsIn(picture, ".png"); }

const char* NameOf(Model model) { return NameIn(kModels, model); }
const char* NameOf(Cone cone) { return NameIn(kCones, cone); }
const char* NameOf(BounceLaw law) { return NameIn(kBounceLaws, law); }
const char* NameOf(Freezing freezing) { return NameIn(kFreezings, freezing); }

void AddRunOptions(CLI::App* command, RunOptions* options) {
  RunOptions& o = *options;
  AddSceneOptions(command, options);
  const auto add = [&](const char* group, const char* name, auto& target, const char* type, const char* help) {
    return command->add_option(name, target, help)->group(group)->type_name(type);
  };
  add(kOutput, "--report", o.report, "FILE|-", "write a JSON report; -: to the standard output, all else to stderr")
      ->check(FileOrDash);
  add(kOutput, "--frames-csv", o.frames_csv, "FILE", "write one row per frame")->check(FileName);
  add(kOutput, "--probes", o.probes, "FILE", "scene file: write what its probes ask for, one row per frame")
      ->check(FileName);
  add(kOutput, "--trace", o.trace, "FILE.json",
      "write where the time went, each island's solve on its core, for ui.perfetto.dev")
      ->check(FileName);
  add(kOutput, "--picture", o.picture, "FILE.svg|FILE.png", "draw the scene, as vectors or as pixels")
      ->check(PictureName);
  CLI::Option* const picture_time =
      AddTime(command, "--picture-time", &o.picture_time, "when to draw (default: at the end)")->group(kOutput);
  add(kOutput, "--picture-frame", o.picture_frame, "N", "draw after N frames, 0: the start")->excludes(picture_time);
  add(kOutput, "--record", o.record, "FILE", "keep every frame for `islet replay FILE`")->check(FileName);
  add(kOutput, "--html", o.html, "FILE", "write a page that shows the run and opens at its worst frame")
      ->check(FileName);
  command->add_flag("--strict", o.strict, "exit status 3 if a step failed: what it did is beyond a bound of the ledger")
      ->group(kOutput);
  add(kOutput, "--export-fclib", o.export_fclib, "DIR",
      "write the contact problems of every frame in FCLIB's HDF5 format")
      ->check(FileName);
  add(kOutput, "--export-frames", o.export_frames, "N,N,...", "of these frames only, the first is 1")->delimiter(',');
  command->footer(
      "Without --frames or --seconds a scene stops when all is at rest, or at its own time limit.\n\n"
      "Examples:\n"
      "  islet run stack --count 5 --seconds 2\n"
      "  islet run cubeglass --count 60 --frames 60 --report report.json --picture glass.png\n"
      "  islet run csstack --seconds 1/2 --dt 1/120 --threads 1 --frames-csv frames.csv\n"
      "  islet run cubejam --frames 30 --trace trace.json\n"
      "  islet run balance --freeze paper --freeze-count 1 --report -\n"
      "  islet run stack --count 3 --frames 4 --group-bodies 0 --export-fclib problems --export-frames 1,3");
}

std::vector<std::string> RunArguments(const CLI::App& command) {
  std::vector<std::string> arguments;
  for (const CLI::Option* option : command.get_options()) {
    if (!Decides(*option)) continue;
    if (option->get_positional()) {
      const std::vector<std::string>& values = option->results();
      arguments.insert(arguments.end(), values.begin(), values.end());
    } else if (option->get_expected_max() == 0) {  // a flag
      if (option->count() > 0 && option->as<bool>()) arguments.push_back(option->get_name());
    } else {
      for (const std::string& value : option->results()) arguments.push_back(option->get_name() + "=" + value);
    }
  }
  return arguments;
}

RunOptions ParseRunArguments(const std::vector<std::string>& arguments) {
  CLI::App command;
  command.set_help_flag();
  RunOptions options;
  AddRunOptions(&command, &options);
  try {
    command.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& error) {
    throw std::invalid_argument(error.what());
  }
  for (const CLI::Option* option : command.get_options())
    if (option->count() > 0 && !Decides(*option))
      throw std::invalid_argument("--" + option->get_lnames().at(0) + " does not decide a run");  // a hidden one, too
  options.arguments = arguments;
  return options;
}

void AddViewOptions(CLI::App* command, RunOptions* options) {
  AddSceneOptions(command, options);
  options->html_plays = true;
  CLI::Option* const out = command->add_option("--out", options->html, "the page to write (default: SCENE.html)")
                               ->group(kOutput)
                               ->type_name("FILE.html")
                               ->check(PageName);
  CLI::Option* const live =
      command->add_flag("--live", options->live, "write nothing: serve the page to this machine while the scene runs")
          ->group(kOutput)
          ->excludes(out);
  for (const char* const end : {"--frames", "--seconds"}) live->excludes(command->get_option(end));
  command->add_option("--port", options->port, "of --live, 1 to 65535 (default: any that is free)")
      ->group(kOutput)
      ->type_name("N")
      ->needs(live)
      ->check(CLI::Range(1, 65535));
}

const Scene& RequireScene(const std::string& name) {
  if (const Scene* scene = FindScene(name)) return *scene;
  std::string names;
  for (const Scene& scene : AllScenes()) names.append(" ").append(scene.name);
  throw std::invalid_argument(fmt::format(
      "scene: there is no \"{}\"; did you mean {}? The scenes are{}; the name of a scene file ends in .json", name,
      NearestScene(name), names));
}

void CheckRunOptions(const RunOptions& options) {
  CheckNumbers(options);
  MakeSettings(options);
  CheckFiles(options);
}

Settings MakeSettings(const RunOptions& o, const Settings& of_scene) {
  Settings settings = of_scene;
  if (o.paper) {
    const Settings paper = Settings::Paper();
    settings.model = paper.model;
    settings.cone = paper.cone;
    settings.bounce_law = paper.bounce_law;
    settings.freezing = paper.freezing;
  }
  if (o.model) settings.model = Choose("--model", *o.model, kModels);
  if (o.cone) settings.cone = Choose("--cone", *o.cone, kCones);
  if (o.ladder) settings.ladder = ParseLadder(*o.ladder);
  if (o.effort) settings.effort = ParseEffort(*o.effort);
  if (o.bounce) settings.bounce_law = Choose("--bounce", *o.bounce, kBounceLaws);
  if (o.bounce_limit) settings.bounce_limit = ParseBounceLimit(*o.bounce_limit);
  if (o.freeze) settings.freezing = Choose("--freeze", *o.freeze, kFreezings);
  if (o.freeze_count) settings.freeze_count = *o.freeze_count;
  if (o.tolerance) settings.tolerance = *o.tolerance;
  if (o.group_bodies) settings.group_bodies = *o.group_bodies;
  const int threads = o.threads.value_or(0);
  settings.threads = threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return settings;
}

}  // namespace islet
