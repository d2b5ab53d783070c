// Files of compressed chunks that are only ever appended to, so that one that was cut off anywhere is whole up to there.
//
//   file    the bytes "isletrec", a version (u32, now 1), then chunks
//   chunk   kind, packed bytes, bytes, CRC-32 of the packed bytes, CRC-32 of these 16 bytes (u32 each, little endian); a zstd frame
//   cut     a chunk that lacks bytes at its end is no error: the file ends before it
//   limits  no claim of a header is believed: what is allocated is bounded by the reader's `most` and by the bytes that are there
//   errors  writing: std::runtime_error with path and reason; reading: std::invalid_argument with path, offset of the chunk and what is wrong
//   threads a writer or a reader belongs to one thread
#pragma once

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "scenes/output_file.h"

namespace islet {

enum class ChunkKind : std::uint32_t { kHead = 1, kFrame = 2, kEnd = 3 };

class ChunkWriter {
 public:
  // The file appears under its name with its first chunk, in place of what had that name before.
  ChunkWriter(const std::string& path, ChunkKind kind, std::string_view bytes);
  ~ChunkWriter();
  void Append(ChunkKind kind, std::string_view bytes);  // one write
  void Close();

 private:
  std::string_view Pack(ChunkKind kind, std::string_view bytes, std::string_view before);

  struct Compressor;
  std::unique_ptr<Compressor> compressor_;
  std::string packed_;
  GrowingFile file_;
};

struct Chunk {
  ChunkKind kind{};
  std::uint64_t offset = 0;  // [bytes] of its header in the file
  std::string bytes;
};

class ChunkReader {
 public:
  explicit ChunkReader(
      const std::string& path);  // errors: also a file that cannot be read, or of another kind or version
  ~ChunkReader();

  // False at the end of the whole chunks. most: [bytes] a chunk of this kind may have.
  bool Next(Chunk* chunk, const std::function<std::uint64_t(ChunkKind)>& most);
  std::uint64_t offset() const { return offset_; }        // [bytes] behind the last whole chunk
  std::uint64_t left_over() const { return left_over_; }  // [bytes] of a chunk that was cut off, once Next() said false

  // Throws, as for a chunk at this offset.
  [[noreturn]] void Refuse(std::uint64_t offset, const std::string& why) const;

 private:
  struct Header {
    std::uint32_t kind = 0, packed = 0, bytes = 0, checksum = 0, header_checksum = 0;
  };
  bool NextHeader(Chunk* chunk);
  bool Unpack(Chunk* chunk, std::uint64_t most);
  bool Read(std::uint64_t count, std::string* bytes);  // false: the file ends before

  std::string path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  Header header_;
  std::uint64_t offset_ = 0, left_over_ = 0;
};

}  // namespace islet
