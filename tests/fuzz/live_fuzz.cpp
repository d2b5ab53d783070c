// Bytes of anybody as messages to a live run: whatever they are, they are done or refused, in bounds of memory and time, and a page can
// be told what came of it. The first byte says what the others are: messages, one a line, or numbers of good messages, at and beside the
// bounds of what these may hold. Behind each is a step.
//   cmake -B build/fuzz -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=RelWithDebInfo -DISLET_BUILD_FUZZ=ON
//     -DISLET_SANITIZE=address,undefined,fuzzer-no-link
//   cmake --build build/fuzz --target fuzz_live
//   build/fuzz/tests/fuzz/fuzz_live -dict=tests/fuzz/live.dict -rss_limit_mb=500 -timeout=10
#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "scenes/film/film.h"
#include "scenes/live/live_run.h"
#include "scenes/viewer/live_page.h"

namespace {

constexpr int kMostSteps = 12;
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

void Step(islet::LiveRun* run) {
  if (!run->Advance()) return;
  const islet::FilmHead head = islet::HeadOf(run->world(), kStep, "fuzz", "", std::nullopt);
  islet::LiveHead(head, 1.0 / 8192);
  islet::LiveFrame(head, islet::FrameOf(run->world(), run->report(), run->steps(), 0, 0), 1.0 / 8192);
}

void DoLines(std::string_view text) {
  islet::LiveRun run = Begin();
  for (int line = 0; !text.empty() && line < kMostSteps; ++line) {
    const size_t end = std::min(text.find('\n'), text.size());
    Obey(text.substr(0, end), &run);
    text.remove_prefix(std::min(end + 1, text.size()));
    Step(&run);
  }
}

// Takes bytes until there are none, then zeros.
class Numbers {
 public:
  explicit Numbers(std::string_view bytes) : bytes_(bytes) {}
  bool empty() const { return bytes_.empty(); }
  unsigned Next() {
    if (bytes_.empty()) return 0;
    const auto byte = static_cast<unsigned char>(bytes_[0]);
    bytes_.remove_prefix(1);
    return byte;
  }
  std::string Number() {
    constexpr std::array kSome{"0",   "1e-300", "1e-9", "0.001", "0.1", "0.25", "0.5", "1",
                               "1.5", "2",      "5",    "9.81",  "50",  "999",  "1e3", "1e6"};
    const unsigned byte = Next();
    return std::string(byte & 16 ? "-" : "") + kSome[byte & 15];
  }
  std::string Vector() { return "[" + Number() + "," + Number() + "," + Number() + "]"; }

 private:
  std::string_view bytes_;
};

std::string Message(Numbers* in) {
  switch (in->Next() % 6) {
    case 0:
      return R"({"do": "drag", "body": )" + std::to_string(in->Next() % 8) + R"(, "at": )" + in->Vector() +
             R"(, "to": )" + in->Vector() + "}";
    case 1:
      return R"({"do": "throw", "from": )" + in->Vector() + R"(, "velocity": )" + in->Vector() + R"(, "radius": )" +
             in->Number() + R"(, "density": )" + in->Number() + "}";
    case 2:
      return R"({"do": "gravity", "value": )" + in->Vector() + "}";
    case 3:
      return R"({"do": "friction", "value": )" + in->Number() + "}";
    case 4:
      return R"({"do": "release"})";
    default:
      return R"({"do": "step"})";
  }
}

void DoGoodMessages(std::string_view bytes) {
  islet::LiveRun run = Begin();
  Obey(R"({"do": "run"})", &run);
  Numbers in(bytes);
  for (int step = 0; step < kMostSteps && !in.empty(); ++step) {
    const std::string message = Message(&in);
    Obey(message, &run);
    Obey(R"({"do": "run"})", &run);
    Step(&run);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (data[0] & 1) {
    DoGoodMessages(bytes);
  } else {
    DoLines(bytes);
  }
  return 0;
}
