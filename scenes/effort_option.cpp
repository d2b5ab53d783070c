#include "scenes/effort_option.h"

#include <fmt/format.h>

#include <charconv>
#include <stdexcept>

#include "scenes/setting_names.h"

#include "scenes/output_file.h"

namespace islet {

Effort ParseEffort(const std::string& text) {
  for (const auto& [name, effort] : kEfforts)
    if (text == name) return effort;
  Effort effort = qp::kNormalEffort;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, effort.sweeps);
  if (error != std::errc() || rest != end || effort.sweeps < 1) {
    throw std::invalid_argument(fmt::format(
        "--effort must be one of quick, normal, thorough, or a number of sweeps of at least 1; got {}", text));
  }
  return effort;
}

std::string NameOf(const Effort& effort) {
  for (const auto& [name, known] : kEfforts)
    if (effort.sweeps == known.sweeps && effort.newton == known.newton) return name;
  return fmt::format("{}", effort.sweeps);
}

void NoteTier(const std::string& value) {
  Print(stderr,
        fmt::format(
            "islet: --tier {} is without effect, use --effort: quick, normal (default), thorough, or so many sweeps\n",
            value));
}

}  // namespace islet
