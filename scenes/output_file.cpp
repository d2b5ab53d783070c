#include "scenes/output_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>

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

}  // namespace

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
    reason = Write(temporary, text);
    std::error_code error;
    if (reason.empty()) {
      fs::rename(temporary, target, error);
      if (error) reason = error.message();
    }
    if (!reason.empty()) fs::remove(temporary, error);
  }
  if (!reason.empty()) throw std::runtime_error("cannot write " + path + ": " + reason);
}

OutputFile::OutputFile(const std::string& path) : path_(path) {
  const fs::path target = Target(path);
  target_ = target.string();
  if (!IsSpecial(target)) temporary_ = TemporaryBeside(target).string();
  errno = 0;
  stream_.open(temporary_.empty() ? target_ : temporary_, std::ios::binary);
  if (!stream_) throw std::runtime_error("cannot write " + path + ": " + std::strerror(errno));
}

OutputFile::~OutputFile() {
  std::error_code error;
  if (!temporary_.empty()) fs::remove(temporary_, error);
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
  temporary_.clear();
}

bool SameOutput(const std::string& a, const std::string& b) {
  const fs::path target = Target(a);
  return target == Target(b) && !IsSpecial(target);
}

}  // namespace islet
