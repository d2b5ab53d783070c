#include "bench/machine.h"

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>

namespace islet::bench {

std::string FirstLineOf(const char* command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command, "r"), pclose);
  char line[256] = "";
  if (!pipe || std::fgets(line, sizeof line, pipe.get()) == nullptr) return "unknown";
  std::string text = line;
  text.erase(text.find_last_not_of('\n') + 1);
  return text;
}

std::string Processor() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.starts_with("model name")) return line.substr(line.find(": ") + 2);
  }
  return "unknown processor";
}

std::string Load() {
  double load[1] = {-1};
  getloadavg(load, 1);
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", load[0]);
  return text;
}

}  // namespace islet::bench
