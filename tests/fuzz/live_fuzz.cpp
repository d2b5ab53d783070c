// Bytes of anybody as messages to a live run, one a line, with a step after each: whatever they are, they are done or refused, in bounds
// of memory and time, and a page can be told what came of it.
//   cmake -B build/fuzz -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=RelWithDebInfo -DISLET_BUILD_FUZZ=ON
//     -DISLET_SANITIZE=address,undefined,fuzzer-no-link
//   cmake --build build/fuzz --target fuzz_live
//   build/fuzz/tests/fuzz/fuzz_live -dict=tests/fuzz/live.dict -rss_limit_mb=500 -timeout=10
#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "scenes/film/film.h"
#include "scenes/live/live_run.h"
#include "scenes/viewer/live_page.h"

namespace {

constexpr int kMostLines = 40;
constexpr double kStep = 1.0 / 60;  // [s]

// Two boxes and a ball on a floor.
islet::LiveRun Begin() {
  islet::Settings settings;
  settings.threads = 1;
  islet::World world(settings);
  world.Add({.shape = islet::Shape::HalfSpace(), .kind = islet::BodyKind::kFixed});
  world.Add({.shape = islet::Shape::Box({0.5, 0.5, 0.5}), .position_W = {0, 0, 0.5}});
  world.Add({.shape = islet::Shape::Box({0.3, 0.4, 0.5}), .position_W = {0, 0, 1.5}});
  world.Add({.shape = islet::Shape::Sphere(0.5), .position_W = {1.5, 0, 0.5}});
  return {std::move(world), kStep};
}

void Obey(std::string_view message, islet::LiveRun* run) {
  try {
    run->Do(islet::ParseCommand(message));
  } catch (const std::invalid_argument&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view text(reinterpret_cast<const char*>(data), size);
  islet::LiveRun run = Begin();
  for (int line = 0; line < kMostLines && !text.empty(); ++line) {
    const size_t end = std::min(text.find('\n'), text.size());
    Obey(text.substr(0, end), &run);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!run.Advance()) continue;
    const islet::FilmHead head = islet::HeadOf(run.world(), kStep, "fuzz", "", std::nullopt);
    islet::LiveHead(head, 1.0 / 8192);
    islet::LiveFrame(head, islet::FrameOf(run.world(), run.report(), run.steps(), 0, 0), 1.0 / 8192);
  }
  return 0;
}
