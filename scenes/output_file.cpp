#include "scenes/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace islet {
namespace {

namespace fs = std::filesystem;

// Follows links, so that the file behind a link is replaced and not the link.
fs::path Target(const std::string& path) {
  std::error_code error;
  const fs::path target =
      fs::weakly_canonical(fs::absolute(path), error);  // absolute: a missing file has no other name
  return error ? fs::path(path) : target;
}

bool IsSpecial(const fs::path& target) {
  std::error_code error;
  return fs::exists(target, error) && !fs::is_regular_file(target, error);
}

fs::path TemporaryBeside(const fs::path& target) {
  fs::path temporary = target;
  temporary += ".part" + std::to_string(::getpid());
  return temporary;
}

// Names of the temporary files that there are. What does not fit in is left by a process that ends at once.
std::array<std::atomic<const char*>, 16> temporaries{};
static_assert(std::atomic<const char*>::is_always_lock_free);  // or a handler could not read them

void Exchange(const char* from, const char* to) {
  const auto slot = std::find(temporaries.begin(), temporaries.end(), from);
  if (slot != temporaries.end()) *slot = to;
}
// The name must stay where it is until it is unlisted.
void List(const std::string& name) { Exchange(nullptr, name.c_str()); }
void Unlist(const std::string& name) { Exchange(name.c_str(), nullptr); }

// Empty if all went well, else the reason.
std::string Write(const fs::path& path, const std::string& text) {
  std::FILE* const file = std::fopen(path.c_str(), "wb");
  if (!file) return std::strerror(errno);
  bool good = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  const int write_error = errno;
  errno = 0;
  good = std::fclose(file) == 0 && good;
  return good ? "" : std::strerror(errno ? errno : write_error);
}

int stdout_error = 0;  // errno of the first text that did not arrive
// Empty if all went well, else the reason.
std::string WriteAll(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written > 0) bytes.remove_prefix(static_cast<size_t>(written));
    if (written < 0 && errno != EINTR) return std::strerror(errno);
  }
  return "";
}

[[noreturn]] void Fail(const std::string& path, const std::string& reason) {
  throw std::runtime_error("cannot write " + path + ": " + reason);
}

}  // namespace

bool Print(std::FILE* stream, const std::string& text) {
  errno = 0;
  const bool good = std::fwrite(text.data(), 1, text.size(), stream) == text.size() && std::fflush(stream) == 0;
  if (!good && stream == stdout && stdout_error == 0) stdout_error = errno ? errno : EIO;
  return good && !std::ferror(stream);
}

void RemoveTemporaries() {
  for (const std::atomic<const char*>& name : temporaries)
    if (const char* const path = name) ::unlink(path);
}

void FinishStandardOutput() {
  Print(stdout, "");
  if (stdout_error != 0)
    throw std::runtime_error(std::string("cannot write to the standard output: ") + std::strerror(stdout_error));
}

void CheckWritable(const std::string& option, const std::string& path) {
  const fs::path target = Target(path);
  std::error_code error;
  std::string reason;
  if (fs::is_directory(target, error)) {
    reason = "it is a directory";
  } else if (fs::exists(target, error) && ::access(target.c_str(), W_OK) != 0) {
    reason = std::strerror(errno);
  } else if (!IsSpecial(target)) {
    const fs::path temporary = TemporaryBeside(target);
    reason = Write(temporary, "");
    fs::remove(temporary, error);
  }
  if (!reason.empty()) throw std::invalid_argument(option + ": cannot write " + path + ": " + reason);
}

void WriteWhole(const std::string& path, const std::string& text) {
  const fs::path target = Target(path);
  std::string reason;
  if (IsSpecial(target)) {
    reason = Write(target, text);
  } else {
    const fs::path temporary = TemporaryBeside(target);
    List(temporary.native());
    reason = Write(temporary, text);
    std::error_code error;
    if (reason.empty()) {
      fs::rename(temporary, target, error);
      if (error) reason = error.message();
    }
    if (!reason.empty()) fs::remove(temporary, error);
    Unlist(temporary.native());
  }
  if (!reason.empty()) Fail(path, reason);
}

OutputFile::OutputFile(const std::string& path) : path_(path) {
  const fs::path target = Target(path);
  target_ = target.string();
  if (!IsSpecial(target)) temporary_ = TemporaryBeside(target).string();
  errno = 0;
  stream_.open(temporary_.empty() ? target_ : temporary_, std::ios::binary);
  if (!stream_) throw std::runtime_error("cannot write " + path + ": " + std::strerror(errno));
  if (!temporary_.empty()) List(temporary_);
}

OutputFile::~OutputFile() {
  std::error_code error;
  if (temporary_.empty()) return;
  fs::remove(temporary_, error);
  Unlist(temporary_);
}

void OutputFile::Commit() {
  errno = 0;
  stream_.close();
  std::string reason = stream_ ? "" : std::strerror(errno);
  if (reason.empty() && !temporary_.empty()) {
    std::error_code error;
    fs::rename(temporary_, target_, error);
    if (error) reason = error.message();
  }
  if (!reason.empty()) throw std::runtime_error("cannot write " + path_ + ": " + reason);
  Unlist(temporary_);
  temporary_.clear();
}

bool SameOutput(const std::string& a, const std::string& b) {
  const fs::path target = Target(a);
  return target == Target(b) && !IsSpecial(target);
}

GrowingFile::GrowingFile(const std::string& path, std::string_view first) : path_(path) {
  const fs::path target = Target(path);
  const bool direct = IsSpecial(target);
  const fs::path place = direct ? target : TemporaryBeside(target);
  file_ = ::open(place.c_str(), O_WRONLY | O_CLOEXEC | (direct ? 0 : O_CREAT | O_TRUNC), 0666);
  if (file_ < 0) Fail(path, std::strerror(errno));
  if (!direct) List(place.native());
  std::string reason = WriteAll(file_, first);
  std::error_code error;
  if (!direct && reason.empty()) {
    fs::rename(place, target, error);
    if (error) reason = error.message();
  }
  if (!reason.empty() && !direct) fs::remove(place, error);
  Unlist(place.native());
  if (!reason.empty()) {
    ::close(file_);
    Fail(path, reason);
  }
  size_ = first.size();
}

GrowingFile::~GrowingFile() {
  if (file_ >= 0) ::close(file_);
}

void GrowingFile::Append(std::string_view piece) {
  if (const std::string reason = WriteAll(file_, piece); !reason.empty()) {
    // A pipe has no length to go back to; there what was written stays.
    if (::ftruncate(file_, static_cast<off_t>(size_)) == 0) ::lseek(file_, static_cast<off_t>(size_), SEEK_SET);
    Fail(path_, reason);
  }
  size_ += piece.size();
}

void GrowingFile::Close() {
  const int file = std::exchange(file_, -1);
  if (file >= 0 && ::close(file) != 0) Fail(path_, std::strerror(errno));
}

}  // namespace islet
