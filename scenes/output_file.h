// What the program writes: files, checked before the run, written whole or not at all; and what it prints.
//
//   - A text goes to a temporary file beside the target, which then takes the target's name in one step.
//   - What is no regular file (/dev/null, a pipe) is written directly.
//   - A file that grows takes the target's name with its first piece, and from then on holds whole pieces. Each is one write, so that a
//     kill at any moment leaves at most a part of the last.
//   - errors: CheckWritable throws std::invalid_argument with the option's name, the others std::runtime_error with path and reason
//   - Print never throws, so that a full disk behind the standard output costs no file: FinishStandardOutput tells it at the end.
//   threads: one caller at a time
#pragma once

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <string_view>

namespace islet {

// Leaves no trace: an existing file keeps its contents, a missing one is not made.
void CheckWritable(const std::string& option, const std::string& path);

void WriteWhole(const std::string& path, const std::string& text);

// Where a file is written that takes the target's name in Commit(). Without it nothing is left.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& path);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  bool direct() const { return temporary_.empty(); }  // there is none: the target itself is written
  const std::string& place() const { return direct() ? target_ : temporary_; }
  void Commit();

 private:
  std::string path_, target_, temporary_;
};

// What is written piece by piece, by the same rules.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path);

  std::ostream& stream() { return stream_; }
  void Commit();

 private:
  std::string path_;
  TemporaryFile file_;
  std::ofstream stream_;
};

bool SameOutput(const std::string& a, const std::string& b);

class GrowingFile {
 public:
  GrowingFile(const std::string& path, std::string_view first);
  ~GrowingFile();
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;

  void Append(std::string_view piece);  // after an error the file ends with the piece before
  void Close();                         // tells what a file system reports only now; nothing can be appended after it

 private:
  std::string path_;
  int file_ = -1;
  std::uint64_t size_ = 0;  // [bytes]
};

// To stdout or stderr, at once. False if it could not be written, now or before.
bool Print(std::FILE* stream, const std::string& text);

// Of files that are being written: for a process that ends at once. May be called by a signal handler.
void RemoveTemporaries();

// Throws std::runtime_error if anything printed to stdout did not arrive. A closed pipe must not have ended the process before:
// the program ignores SIGPIPE.
void FinishStandardOutput();

}  // namespace islet
