// Bytes of anybody as a recording: whatever they are, they are read or refused, in bounds of memory and time.
//   cmake -B build/fuzz -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=RelWithDebInfo -DISLET_BUILD_FUZZ=ON
//     -DISLET_SANITIZE=address,undefined,fuzzer-no-link
//   cmake --build build/fuzz --target fuzz_film && build/fuzz/tests/fuzz/fuzz_film -rss_limit_mb=500 -timeout=10
// The first byte says what the others are: a file, a head, a frame of two bodies, or a head and frames in chunks that are whole.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <string_view>

#include "scenes/film/film_file.h"
#include "scenes/film/film_gltf.h"
#include "scenes/film/film_head.h"
#include "scenes/film/frame_code.h"

namespace {

void Require(bool right) {
  if (!right) std::abort();
}

const std::string& Path() {
  static const int file = memfd_create("film", 0);
  static const std::string path = "/proc/self/fd/" + std::to_string(file);
  return path;
}

void Read() {
  try {
    islet::FilmFrame frame;
    for (islet::FilmReader whole(Path()); whole.Next(&frame);) {
    }
    islet::FilmReader reader(Path());
    islet::FilmToGlb(&reader);
  } catch (const std::invalid_argument&) {
  }
}

void ReadFile(std::string_view bytes) {
  const int file = std::atoi(Path().c_str() + 14);
  Require(ftruncate(file, 0) == 0 && pwrite(file, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()));
  Read();
}

// What was read is written as it was.
void ReadHead(std::string_view bytes) {
  std::string text;
  try {
    text = islet::HeadToJson(islet::HeadFromJson(bytes));
  } catch (const std::invalid_argument&) {
    return;
  }
  Require(islet::HeadToJson(islet::HeadFromJson(text)) == text);
}

void ReadFrame(std::string_view bytes) {
  try {
    const islet::FilmFrame frame = islet::DecodeFrame(bytes, nullptr, 2);
    Require(islet::EncodeFrame(frame, nullptr, 2) == bytes);
    Require(islet::EncodeFrame(islet::DecodeFrame(bytes, nullptr, 2), nullptr, 2) == bytes);
  } catch (const std::invalid_argument&) {
  }
}

// Head, a byte 0, then frames of one size each with the number of their contacts before them.
void ReadChunks(std::string_view bytes) {
  const size_t end = std::min(bytes.find('\0'), bytes.size());
  const std::string_view head = bytes.substr(0, end);
  size_t bodies = 0;
  try {
    bodies = islet::HeadFromJson(head).bodies.size();
  } catch (const std::invalid_argument&) {
    return;
  }
  // A file of its own: this one takes the name of what it writes.
  const std::string path = "/tmp/islet_fuzz_" + std::to_string(getpid());
  {
    islet::ChunkWriter writer(path, islet::ChunkKind::kHead, head);
    bytes.remove_prefix(std::min(bytes.size(), end + 1));
    while (!bytes.empty()) {
      const size_t size = std::min<size_t>(bytes.size() - 1, islet::FrameBytes(bodies, bytes[0] & 3));
      writer.Append(islet::ChunkKind::kFrame, bytes.substr(1, size));
      bytes.remove_prefix(1 + size);
    }
  }
  try {
    islet::FilmReader reader(path);
    islet::FilmToGlb(&reader);
  } catch (const std::invalid_argument&) {
  }
  unlink(path.c_str());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0] & 3) {
    case 0:
      ReadFile(bytes);
      break;
    case 1:
      ReadHead(bytes);
      break;
    case 2:
      ReadFrame(bytes);
      break;
    default:
      ReadChunks(bytes);
  }
  return 0;
}
