#include "scenes/view.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <stdexcept>

#include "scenes/film/film_file.h"
#include "scenes/output_file.h"
#include "scenes/run.h"
#include "scenes/run_page.h"
#include "scenes/view_live.h"

namespace islet {
namespace {

int CountFrames(const std::string& recording) {
  FilmReader reader(recording);
  FilmFrame frame;
  int frames = 0;
  while (reader.Next(&frame)) ++frames;
  return frames;
}

void ViewRecording(const std::string& recording, const std::string& out) {
  if (SameOutput(recording, out)) throw std::invalid_argument("--out would overwrite " + recording);
  CheckWritable("--out", out);
  const int frames = CountFrames(recording);
  if (frames == 0) throw std::invalid_argument(recording + ": holds no frame");
  FilmReader reader(recording);
  RunPage page(out, reader.head(), {PageStart::kBeginning, frames});
  FilmFrame frame;
  while (reader.Next(&frame)) page.Add(frame);
  Print(stdout, page.Finish(reader.stopped_by().empty() ? "the recording was cut off" : reader.stopped_by()));
}

}  // namespace

void View(RunOptions options) {
  const std::filesystem::path name = options.scene;
  const bool recorded =
      !FindScene(options.scene) && name.extension() != ".json" && std::filesystem::is_regular_file(name);
  if (options.live) {
    if (recorded) throw std::invalid_argument("--live runs a scene; got the recording " + options.scene);
    ViewLive(options);
    return;
  }
  if (options.html.empty()) options.html = name.stem().string() + ".html";
  if (!recorded) {
    RunScene(options);
    return;
  }
  if (options.arguments.size() > 1)
    throw std::invalid_argument(
        fmt::format("{} is a recording, which {} cannot change", options.scene, options.arguments[1]));
  ViewRecording(options.scene, options.html);
}

}  // namespace islet
