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

bool IsOfSystem(const fs::path& place) {
  return place.string().starts_with("/dev/") || place.string().starts_with("/proc/");
}

// Follows links, so that the file behind a link is replaced and not the link, also where it is missing yet. What the system names, as
// /dev/stdout, stays: behind it is a file that is open already.
fs::path Target(const std::string& path) {
  std::error_code error;
  fs::path place = fs::absolute(path, error).lexically_normal();
  for (int links = 0; links < 40 && !IsOfSystem(place) && fs::is_symlink(place, error); ++links)
    place = (place.parent_path() / fs::read_symlink(place, error)).lexically_normal();
  if (IsOfSystem(place)) return place;
  const fs::path target = fs::weakly_canonical(place, error);  // absolute: a missing file has no other name
  return error ? fs::path(path) : target;
}

bool IsSpecial(const fs::path& target) {
  std::error_code error;
  return IsOfSystem(target) || (fs::exists(target, error) && !fs::is_regular_file(target, error));
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
  } else if (IsOfSystem(target) && fs::is_regular_file(target, error)) {
    reason = "behind it is a file that is open already";
  } else if (!IsSpecial(target)) {
    try {
      const OutputFile probe(path);
    } catch (const std::runtime_error& refused) {
      throw std::invalid_argument(option + ": " + refused.what());
    }
  }
  if (!reason.empty()) throw std::invalid_argument(option + ": cannot write " + path + ": " + reason);
}

TemporaryFile::TemporaryFile(const std::string& path) : path_(path) {
  const fs::path target = Target(path);
  target_ = target.string();
  if (IsSpecial(target)) return;
  temporary_ = TemporaryBeside(target).string();
  List(temporary_);
}

TemporaryFile::~TemporaryFile() {
  std::error_code error;
  if (direct()) return;
  fs::remove(temporary_, error);
  Unlist(temporary_);
}

void TemporaryFile::Commit() {
  if (direct()) return;
  std::error_code error;
  fs::rename(temporary_, target_, error);
  if (error) Fail(path_, error.message());
  Unlist(temporary_);
  temporary_.clear();
}

OutputFile::OutputFile(const std::string& path) : path_(path), file_(path) {
  errno = 0;
  stream_.open(file_.place(), std::ios::binary);
  if (!stream_) Fail(path, std::strerror(errno));
}

void OutputFile::Commit() {
  if (stream_) errno = 0;  // else it says why
  stream_.close();
  if (!stream_) Fail(path_, std::strerror(errno ? errno : EIO));
  file_.Commit();
}

void WriteWhole(const std::string& path, const std::string& text) {
  OutputFile file(path);
  errno = 0;
  file.stream() << text;
  file.Commit();
}

bool SameOutput(const std::string& a, const std::string& b) {
  const fs::path target = Target(a);
  return target == Target(b) && !IsSpecial(target);
}

GrowingFile::GrowingFile(const std::string& path, std::string_view first) : path_(path), size_(first.size()) {
  TemporaryFile file(path);
  file_ = ::open(file.place().c_str(), O_WRONLY | O_CLOEXEC | (file.direct() ? 0 : O_CREAT | O_TRUNC), 0666);
  if (file_ < 0) Fail(path, std::strerror(errno));
  try {
    if (const std::string reason = WriteAll(file_, first); !reason.empty()) Fail(path, reason);
    file.Commit();
  } catch (...) {
    ::close(file_);
    throw;
  }
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
