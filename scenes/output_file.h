// Files that the program writes: checked before the run, written whole or not at all.
//
//   - A text goes to a temporary file beside the target, which then takes the target's name in one step.
//   - What is no regular file (/dev/null, a pipe) is written directly.
//   - errors: CheckWritable throws std::invalid_argument with the option's name; WriteWhole throws std::runtime_error
#pragma once

#include <fstream>
#include <string>

namespace islet {

// Leaves no trace: an existing file keeps its contents, a missing one is not made.
void CheckWritable(const std::string& option, const std::string& path);

void WriteWhole(const std::string& path, const std::string& text);

// What is written piece by piece, by the same rules: it takes the target's name in Commit(). Without it nothing is left.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  std::ostream& stream() { return stream_; }
  void Commit();

 private:
  std::string path_, target_, temporary_;  // temporary: empty if it is written directly
  std::ofstream stream_;
};

bool SameOutput(const std::string& a, const std::string& b);

}  // namespace islet
