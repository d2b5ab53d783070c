#include "scenes/effort_option.h"

#include <fmt/format.h>

#include <charconv>
#include <stdexcept>

#include "scenes/output_file.h"
#include "scenes/setting_names.h"

namespace islet {

Effort ParseEffort(const std::string& text) {
  if (const std::optional<Effort> known = ValueIn(kEfforts, text)) return *known;
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
  const char* const name = NameIn(kEfforts, effort);
  return name ? name : fmt::format("{}", effort.sweeps);
}

void NoteTier(const std::string& value) {
  Print(stderr,
        fmt::format(
            "islet: --tier {} is without effect, use --effort: quick, normal (default), thorough, or so many sweeps\n",
            value));
}

}  // namespace islet
