#include "scenes/replay.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <stdexcept>

#include "scenes/about.h"
#include "scenes/film/film_file.h"
#include "scenes/film/film_gltf.h"
#include "scenes/output_file.h"
#include "scenes/printable.h"
#include "scenes/ready_scene.h"
#include "scenes/run.h"

namespace islet {
namespace {

std::string Bytes(double bytes) {
  return bytes < 1e6 ? fmt::format("{:.3g} kB", bytes / 1e3) : fmt::format("{:.4g} MB", bytes / 1e6);
}

void Tell(const std::string& path) {
  FilmReader reader(path);
  const FilmHead& head = reader.head();
  int frames = 0;
  FilmFrame last;
  while (reader.Next(&last)) ++frames;
  const auto moving = std::count_if(head.bodies.begin(), head.bodies.end(),
                                    [](const FilmBody& body) { return body.kind != BodyKind::kFixed; });
  std::string text =
      fmt::format("{}: {}, {} frames of {:.4g} s, {:.2f} s\n", path, Printable(head.scene), frames, head.dt, last.time);
  text += fmt::format("  command     {}\n  by          islet {}\n", Printable(head.command), Printable(head.version));
  text += fmt::format("  bodies      {} that move, {} others, {} shapes\n", moving,
                      static_cast<long>(head.bodies.size()) - moving, head.shapes.size());
  std::error_code error;
  if (const auto size = static_cast<double>(std::filesystem::file_size(path, error)); !error && frames > 0)
    text += fmt::format("  size        {}, {} a frame\n", Bytes(size), Bytes(size / frames));
  if (frames > 0) text += fmt::format("  state hash  {:016x} in frame {}, the last\n", last.state_hash, last.number);
  if (!reader.stopped_by().empty())
    text += fmt::format("  end         complete, stopped by {}\n", Printable(reader.stopped_by()));
  else if (frames > 0)
    text +=
        fmt::format("  end         cut off behind frame {}; {} bytes of another\n", last.number, reader.left_over());
  else
    text += fmt::format("  end         cut off before the first frame; {} bytes of it\n", reader.left_over());
  Print(stdout, text);
}

// Why a run ends by itself; another reason came from outside, and does not come again.
bool EndsByItself(const std::string& stopped_by) {
  return stopped_by == "frames" || stopped_by == "seconds" || stopped_by == "rest" || stopped_by == "time limit";
}

// Whether it came to the end: an interrupt may come before.
bool Check(const ReplayOptions& options) {
  const std::string& path = options.file;
  FilmReader reader(path);
  const FilmHead& head = reader.head();
  if (head.arguments.empty()) throw std::invalid_argument(path + ": does not tell the command that made it");
  for (const std::string& argument : head.arguments)
    if (Printable(argument) != argument)
      throw std::invalid_argument(path + ": its command has control characters: " + Printable(head.command));
  RunOptions run;
  try {
    run = ParseRunArguments(head.arguments);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{}: its command cannot be run: {}", path, Printable(error.what())));
  }
  run.threads = options.threads;
  if (IsSceneFile(run.scene)) {
    if (head.scene_text.empty())
      throw std::invalid_argument(path + ": does not hold the text of its scene file " + Printable(run.scene));
    run.scene_text = head.scene_text;  // whatever stands in the file by now
  }
  if (head.version != Version())
    Print(stderr, fmt::format("islet: {} was recorded by islet {}, this is {}; they may differ\n", path,
                              Printable(head.version), Version()));

  int frames = 0;
  FilmFrame recorded;
  bool more = reader.Next(&recorded);  // one frame ahead
  if (!more) throw std::invalid_argument(path + ": holds no frame, so there is nothing to compare");
  std::string difference;
  const RunEnd end = RunScene(run, [&](const World& world, int frame) {
    if (!more) {
      difference = fmt::format("the recording ends with frame {} by {}, this run goes on", recorded.number,
                               Printable(reader.stopped_by()));
    } else if (world.bodies().size() != head.bodies.size()) {
      difference = fmt::format("frame {} differs: {} bodies are recorded, this run has {}", frame, head.bodies.size(),
                               world.bodies().size());
    } else if (frame != recorded.number || world.StateHash() != recorded.state_hash) {
      difference = fmt::format(
          "frame {} differs, at {:.4g} s: state hash {:016x} in frame {} of the recording, {:016x} in this run", frame,
          world.time(), recorded.state_hash, recorded.number, world.StateHash());
    }
    if (!difference.empty()) return false;
    ++frames;
    more = reader.Next(&recorded);
    return more || EndsByItself(reader.stopped_by());
  });
  if (!difference.empty()) throw std::runtime_error(path + ": " + difference);
  if (end.stopped_by == "interrupt") {
    Print(stdout,
          fmt::format("{}: interrupted: the first {} frames are the same, bit for bit; the others were not compared\n",
                      path, frames));
    return false;
  }
  if (more)
    throw std::runtime_error(
        fmt::format("{}: this run ends with frame {} by {}, the recording goes on", path, frames - 1, end.stopped_by));
  if (EndsByItself(reader.stopped_by()) && end.stopped_by != reader.stopped_by())
    throw std::runtime_error(fmt::format("{}: the recording was stopped by {}, this run by {}", path,
                                         Printable(reader.stopped_by()), end.stopped_by));
  Print(stdout, fmt::format("{}: all {} frames are the same, bit for bit{}\n", path, frames,
                            reader.stopped_by().empty() ? "; it is cut off behind them" : ""));
  return true;
}

void Convert(const ReplayOptions& options) {
  std::string bytes;
  try {
    FilmReader reader(options.file);
    bytes = FilmToGlb(&reader);
  } catch (const std::invalid_argument& error) {
    const std::string what = error.what();
    throw std::invalid_argument(what.starts_with(options.file) ? what : options.file + ": " + what);
  }
  WriteWhole(options.out, bytes);
  Print(stdout, fmt::format("{}: {}\n", options.out, Bytes(static_cast<double>(bytes.size()))));
}

}  // namespace

void AddReplayOptions(CLI::App* command, ReplayOptions* options) {
  command->add_option("file", options->file, "what `islet run SCENE --record FILE` wrote")
      ->required()
      ->type_name("FILE");
  command->add_flag("--check", options->check, "run it again and compare the state hash of every frame");
  command->add_option("--out", options->out, "write it as glTF 2.0 with animation, for Blender")
      ->type_name("FILE.glb")
      ->check([](const std::string& name) { return name.ends_with(".glb") ? "" : "must end in .glb; got " + name; });
  command->add_option("--threads", options->threads, "of --check; 0: all cores (default)")->type_name("N");
  command->footer(
      "Without --check and --out it prints what the recording holds.\n\n"
      "Examples:\n"
      "  islet run cubejam --count 20 --frames 20 --record jam.film\n"
      "  islet replay jam.film\n"
      "  islet replay jam.film --check --out jam.glb");
}

void Replay(const ReplayOptions& options) {
  const bool convert = !options.out.empty();
  if (convert) {
    if (SameOutput(options.out, options.file)) throw std::invalid_argument("--out would overwrite " + options.file);
    CheckWritable("--out", options.out);
  }
  if (options.threads && !options.check)
    throw std::invalid_argument(fmt::format("--threads {} needs --check", *options.threads));
  if (options.check && !Check(options)) return;
  if (convert) Convert(options);
  if (!options.check && !convert) Tell(options.file);
}

}  // namespace islet
