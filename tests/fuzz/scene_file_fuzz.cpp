// Text of anybody as a scene file: whatever it is, it is read or refused, in bounds of memory and time; what was made of it is
// written, read again, and has the same state.
//   cmake -B build/fuzz -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=RelWithDebInfo -DISLET_BUILD_FUZZ=ON
//     -DISLET_SANITIZE=address,undefined,fuzzer-no-link
//   cmake --build build/fuzz --target fuzz_scene_file && build/fuzz/tests/fuzz/fuzz_scene_file -rss_limit_mb=500 -timeout=10
//     -dict=tests/fuzz/scene_file.dict CORPUS scenes/samples
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>

#include "scenes/file/document.h"
#include "scenes/file/scene_maker.h"
#include "scenes/file/scene_reader.h"
#include "scenes/file/scene_writer.h"

namespace {

double CountOf(const islet::BodyEntry& entry) {
  if (const auto* grid = std::get_if<islet::GridRepetition>(&entry.repetition))
    return double{1} * grid->counts[0] * grid->counts[1] * grid->counts[2];
  if (const auto* stack = std::get_if<islet::StackRepetition>(&entry.repetition)) return stack->count;
  if (const auto* cloud = std::get_if<islet::CloudRepetition>(&entry.repetition)) return cloud->count;
  return 1;
}

// Nothing where there are so many bodies that the world alone takes its time.
std::unique_ptr<islet::MadeScene> Make(std::string text) {
  const islet::SceneDescription description =
      islet::ReadScene(std::make_shared<const islet::Document>("fuzz.json", std::move(text)));
  double count = 0;
  for (const islet::BodyEntry& entry : description.bodies) count += CountOf(entry);
  if (count > 300) return nullptr;
  islet::Settings settings = description.settings;
  settings.threads = 1;
  return std::make_unique<islet::MadeScene>(islet::MakeScene(description, settings, description.seed));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::unique_ptr<islet::MadeScene> made;
  try {
    made = Make({reinterpret_cast<const char*>(data), size});
  } catch (const std::invalid_argument&) {
  }
  if (!made) return 0;
  const std::unique_ptr<islet::MadeScene> again = Make(islet::WriteScene(made->world, {}));
  if (!again || again->world.bodies().size() != made->world.bodies().size()) std::abort();
  return 0;
}
