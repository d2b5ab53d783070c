// The CSV file of a study: lines that start with # and tell machine, compiler, commit and libraries, then the names of the
// columns, then rows, each flushed when it is complete. Doubles keep six digits, state hashes are written in hexadecimal.
//
//   errors: std::runtime_error if the file cannot be written
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

namespace islet::studies {

class StudyCsv {
 public:
  // versions: of the libraries that the study measures ("ipopt 3.11.9"). columns: comma separated; `load` is appended to them.
  StudyCsv(const std::string& path, const std::vector<std::string>& versions, const std::string& columns);

  // Text must hold no comma.
  template <typename... Cells>
  void Row(const Cells&... cells) {
    std::ostringstream line;
    line.precision(6);
    ((line << cells << ','), ...);
    WriteLine(line.str());
  }

 private:
  void WriteLine(const std::string& cells);  // and the load average of the last minute

  std::string path_;
  std::ofstream file_;
};

std::string Hex(std::uint64_t hash);

// [s] of the wall clock and of the processor, all threads of the process together, since it was made.
class StudyClock {
 public:
  StudyClock();
  double Wall() const;
  double Cpu() const;

 private:
  double wall_, cpu_;
};

// A line on the standard error.
void Say(const std::string& line);

// The rest of a study's main: reads the command line, runs, says what was wrong. Returns the exit status.
int RunStudy(CLI::App* app, int argc, char** argv, const std::function<void()>& run);

}  // namespace islet::studies
