#include "bench/studies/study_csv.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <stdexcept>

#include "bench/machine.h"

namespace islet::studies {
namespace {

double SecondsOf(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

StudyCsv::StudyCsv(const std::string& path, const std::vector<std::string>& versions, const std::string& columns)
    : path_(path), file_(path) {
  utsname system{};
  uname(&system);
  file_ << "# machine: " << bench::Processor() << ", " << sysconf(_SC_NPROCESSORS_ONLN) << " cores, " << system.sysname
        << ' ' << system.release << "\n# compiler: " << ISLET_COMPILER << "\n# commit: "
        << bench::FirstLineOf("git -C '" ISLET_SOURCE_DIR "' describe --always --dirty --exclude '*' 2>/dev/null")
        << "\n# versions: islet " << ISLET_VERSION;
  for (const std::string& version : versions) file_ << "; " << version;
  file_ << "\n# load average of the machine: at the start " << bench::Load() << "; of each row in its last column\n"
        << columns << ",load\n"
        << std::flush;
  if (!file_) throw std::runtime_error("cannot write " + path);
}

void StudyCsv::WriteLine(const std::string& cells) {
  file_ << cells << bench::Load() << '\n' << std::flush;
  if (!file_) throw std::runtime_error("cannot write " + path_);
}

std::string Hex(std::uint64_t hash) {
  char text[20];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

StudyClock::StudyClock() : wall_(SecondsOf(CLOCK_MONOTONIC)), cpu_(SecondsOf(CLOCK_PROCESS_CPUTIME_ID)) {}
double StudyClock::Wall() const { return SecondsOf(CLOCK_MONOTONIC) - wall_; }
double StudyClock::Cpu() const { return SecondsOf(CLOCK_PROCESS_CPUTIME_ID) - cpu_; }

void Say(const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); }

int RunStudy(CLI::App* app, int argc, char** argv, const std::function<void()>& run) {
  CLI11_PARSE(*app, argc, argv);
  try {
    run();
  } catch (const std::exception& error) {
    Say(error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}

}  // namespace islet::studies
