#include "scenes/film/film_file.h"

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "scenes/film/film_head.h"
#include "scenes/film/frame_code.h"

namespace islet {
namespace {

constexpr std::uint64_t kMostEndBytes = 1000;

// What is written can be read: the limits are those of the reader.
std::string CheckedHead(const std::string& path, const FilmHead& head) {
  try {
    std::string text = HeadToJson(head);
    if (text.size() > kMostHeadBytes)
      throw std::invalid_argument("its head would have " + std::to_string(text.size()) + " bytes, at most " +
                                  std::to_string(kMostHeadBytes) + " are right");
    HeadFromJson(text);
    return text;
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(path + ": cannot be recorded: " + error.what());
  }
}

}  // namespace

FilmWriter::FilmWriter(const std::string& path, const FilmHead& head)
    : path_(path), bodies_(head.bodies.size()), file_(path, ChunkKind::kHead, CheckedHead(path, head)) {}

void FilmWriter::Add(const FilmFrame& frame) {
  std::string bytes;
  try {
    bytes = EncodeFrame(frame, frames_ > 0 ? &before_ : nullptr, bodies_);
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(path_ + ": frame " + std::to_string(frame.number) +
                             " cannot be recorded: " + error.what());
  }
  file_.Append(ChunkKind::kFrame, bytes);
  before_ = frame;
  ++frames_;
}

void FilmWriter::Finish(const std::string& stopped_by) {
  const nlohmann::ordered_json end{{"stopped_by", stopped_by}, {"frames", frames_}};
  file_.Append(ChunkKind::kEnd, end.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  file_.Close();
}

FilmReader::FilmReader(const std::string& path) : file_(path) {
  const std::uint64_t start = file_.offset();
  Chunk chunk;
  if (!NextChunk(&chunk)) file_.Refuse(start, "the recording ends within its head, so nothing of it can be read");
  if (chunk.kind != ChunkKind::kHead) file_.Refuse(chunk.offset, "the first chunk is not the head");
  try {
    head_ = HeadFromJson(chunk.bytes);
  } catch (const std::invalid_argument& error) {
    file_.Refuse(chunk.offset, std::string("head: ") + error.what());
  }
}

bool FilmReader::NextChunk(Chunk* chunk) {
  return file_.Next(chunk, [&](ChunkKind kind) {
    if (kind == ChunkKind::kHead) return static_cast<std::uint64_t>(kMostHeadBytes);
    return kind == ChunkKind::kFrame ? FrameBytes(head_.bodies.size(), kMostFrameContacts) : kMostEndBytes;
  });
}

bool FilmReader::Next(FilmFrame* frame) {
  Chunk chunk;
  if (!stopped_by_.empty() || !NextChunk(&chunk)) return false;
  if (chunk.kind == ChunkKind::kHead) file_.Refuse(chunk.offset, "a second head");
  if (chunk.kind == ChunkKind::kFrame) {
    try {
      before_ = DecodeFrame(chunk.bytes, frames_ > 0 ? &before_ : nullptr, head_.bodies.size());
    } catch (const std::invalid_argument& error) {
      file_.Refuse(chunk.offset, "the frame behind " + std::to_string(frames_) + " others: " + error.what());
    }
    ++frames_;
    *frame = before_;
    return true;
  }
  const auto end = nlohmann::json::parse(chunk.bytes, nullptr, false);
  const bool right = end.is_object() && end.contains("stopped_by") && end["stopped_by"].is_string() &&
                     !end["stopped_by"].get<std::string>().empty() && end.contains("frames") &&
                     end["frames"] == frames_;
  if (!right)
    file_.Refuse(chunk.offset, "the end does not tell why it ended after " + std::to_string(frames_) + " frames");
  const std::string stopped_by = end["stopped_by"].get<std::string>();
  const std::uint64_t behind = file_.offset();
  if (NextChunk(&chunk) || file_.left_over() > 0) file_.Refuse(behind, "the recording goes on behind its end");
  stopped_by_ = stopped_by;
  return false;
}

}  // namespace islet
