#include "scenes/film/chunk_file.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <limits>
#include <stdexcept>

namespace islet {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view kMagic = "isletrec";
constexpr std::uint32_t kVersion = 1;
constexpr size_t kPreamble = 12;           // [bytes] magic and version
constexpr size_t kHeader = 20;             // [bytes]
constexpr int kLevel = 3;                  // of zstd
constexpr std::uint64_t kPiece = 1 << 20;  // [bytes] that are read at once

constexpr std::array<std::uint32_t, 256> MakeCrcTable() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ ((value & 1) ? 0xedb88320u : 0);
    table[i] = value;
  }
  return table;
}

// CRC-32 as zlib and PNG have it: it sees every change of up to 32 bits in a row.
std::uint32_t Crc32(std::string_view bytes) {
  static constexpr std::array<std::uint32_t, 256> kTable = MakeCrcTable();
  std::uint32_t state = ~0u;
  for (const char byte : bytes) state = (state >> 8) ^ kTable[(state ^ static_cast<unsigned char>(byte)) & 0xff];
  return ~state;
}

void Put(std::uint32_t value, char* at) { std::memcpy(at, &value, sizeof value); }

std::uint32_t Get(std::string_view bytes, size_t at) {
  std::uint32_t value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

std::string Preamble() {
  std::string bytes(kMagic);
  bytes.resize(kPreamble);
  Put(kVersion, &bytes[kMagic.size()]);
  return bytes;
}

}  // namespace

struct ChunkWriter::Compressor {
  ZSTD_CCtx* context = ZSTD_createCCtx();
  ~Compressor() { ZSTD_freeCCtx(context); }
};

ChunkWriter::ChunkWriter(const std::string& path, ChunkKind kind, std::string_view bytes)
    : compressor_(std::make_unique<Compressor>()), file_(path, Pack(kind, bytes, Preamble())) {}

ChunkWriter::~ChunkWriter() = default;

void ChunkWriter::Append(ChunkKind kind, std::string_view bytes) { file_.Append(Pack(kind, bytes, "")); }

void ChunkWriter::Close() { file_.Close(); }

std::string_view ChunkWriter::Pack(ChunkKind kind, std::string_view bytes, std::string_view before) {
  if (bytes.size() > std::numeric_limits<std::uint32_t>::max() / 2)
    throw std::runtime_error("a chunk of " + std::to_string(bytes.size()) + " bytes is too large");
  const size_t start = before.size() + kHeader;
  packed_.assign(before);
  packed_.resize(start + ZSTD_compressBound(bytes.size()));
  const size_t size = ZSTD_compressCCtx(compressor_->context, packed_.data() + start, packed_.size() - start,
                                        bytes.data(), bytes.size(), kLevel);
  if (ZSTD_isError(size)) throw std::runtime_error(std::string("compression failed: ") + ZSTD_getErrorName(size));
  packed_.resize(start + size);
  char* const header = packed_.data() + before.size();
  Put(static_cast<std::uint32_t>(kind), header);
  Put(static_cast<std::uint32_t>(size), header + 4);
  Put(static_cast<std::uint32_t>(bytes.size()), header + 8);
  Put(Crc32(std::string_view(packed_).substr(start)), header + 12);
  Put(Crc32({header, 16}), header + 16);
  return packed_;
}

ChunkReader::ChunkReader(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "rb"), std::fclose) {
  std::error_code error;
  if (!file_ || std::filesystem::is_directory(path, error))
    throw std::invalid_argument(path + ": cannot be read: " + std::strerror(file_ ? EISDIR : errno));
  std::string bytes;
  const bool whole = Read(kPreamble, &bytes);
  if (bytes.empty()) throw std::invalid_argument(path + ": is empty");
  if (!std::string_view(bytes).substr(0, kMagic.size()).starts_with(kMagic.substr(0, bytes.size())))
    throw std::invalid_argument(path + ": byte 0: this is no recording of islet");
  if (!whole)
    throw std::invalid_argument(path + ": ends after " + std::to_string(bytes.size()) + " bytes, before its head");
  if (const std::uint32_t version = Get(bytes, kMagic.size()); version != kVersion)
    throw std::invalid_argument(path + ": byte 8: a recording of version " + std::to_string(version) +
                                ", this program reads version " + std::to_string(kVersion));
  offset_ = kPreamble;
}

ChunkReader::~ChunkReader() = default;

void ChunkReader::Refuse(std::uint64_t offset, const std::string& why) const {
  throw std::invalid_argument(path_ + ": byte " + std::to_string(offset) + ": " + why);
}

bool ChunkReader::Read(std::uint64_t count, std::string* bytes) {
  bytes->clear();
  while (bytes->size() < count) {
    const size_t had = bytes->size(), want = std::min<size_t>(count - had, kPiece);
    bytes->resize(had + want);
    const size_t got = std::fread(bytes->data() + had, 1, want, file_.get());
    bytes->resize(had + got);
    if (got == want) continue;
    if (std::ferror(file_.get())) throw std::invalid_argument(path_ + ": cannot be read: " + std::strerror(errno));
    return false;
  }
  return true;
}

bool ChunkReader::Next(Chunk* chunk, const std::function<std::uint64_t(ChunkKind)>& most) {
  return NextHeader(chunk) && Unpack(chunk, most(chunk->kind));
}

bool ChunkReader::NextHeader(Chunk* chunk) {
  std::string bytes;
  if (!Read(kHeader, &bytes)) {
    left_over_ = bytes.size();
    return false;
  }
  header_ = {Get(bytes, 0), Get(bytes, 4), Get(bytes, 8), Get(bytes, 12), Get(bytes, 16)};
  if (Crc32({bytes.data(), 16}) != header_.header_checksum)
    Refuse(offset_, "a chunk's header is damaged (checksum); all before it is whole");
  if (header_.kind < 1 || header_.kind > 3)
    Refuse(offset_, "a chunk is of the unknown kind " + std::to_string(header_.kind));
  chunk->kind = static_cast<ChunkKind>(header_.kind);
  chunk->offset = offset_;
  return true;
}

bool ChunkReader::Unpack(Chunk* chunk, std::uint64_t most) {
  if (header_.bytes > most)
    Refuse(offset_, "a chunk claims " + std::to_string(header_.bytes) + " bytes, at most " + std::to_string(most) +
                        " are right");
  if (header_.packed > ZSTD_compressBound(header_.bytes))
    Refuse(offset_,
           "a chunk claims " + std::to_string(header_.packed) + " packed bytes for " + std::to_string(header_.bytes));
  std::string packed;
  if (!Read(header_.packed, &packed)) {
    left_over_ = kHeader + packed.size();
    return false;
  }
  if (Crc32(packed) != header_.checksum) Refuse(offset_, "a chunk is damaged (checksum); all before it is whole");
  // A frame tells its size. What does not is not of ours, and would let a few bytes ask for a large block.
  if (ZSTD_getFrameContentSize(packed.data(), packed.size()) != header_.bytes)
    Refuse(offset_, "a chunk does not have the size that its header claims");
  chunk->bytes.resize(header_.bytes);
  const size_t size = ZSTD_decompress(chunk->bytes.data(), chunk->bytes.size(), packed.data(), packed.size());
  if (ZSTD_isError(size)) Refuse(offset_, std::string("a chunk cannot be unpacked: ") + ZSTD_getErrorName(size));
  if (size != header_.bytes) Refuse(offset_, "a chunk does not have the size that its header claims");
  offset_ += kHeader + header_.packed;
  return true;
}

}  // namespace islet
