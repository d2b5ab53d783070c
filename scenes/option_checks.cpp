#include "scenes/option_checks.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <stdexcept>

#include "scenes/seconds_option.h"

namespace islet {
namespace {

template <typename T>
void Require(const char* option, const T& value, bool good, const char* rule) {
  if (!good) throw std::invalid_argument(fmt::format("{} must be {}; got {}", option, rule, value));
}

}  // namespace

void RequireRange(const char* option, double value, bool good, const char* rule) { Require(option, value, good, rule); }
void RequireRange(const char* option, int value, bool good, const char* rule) { Require(option, value, good, rule); }
void RequireRange(const char* option, const std::string& value, bool good, const char* rule) {
  Require(option, value, good, rule);
}

std::string FileOrDash(const std::string& name) { return name.empty() ? "must be the name of a file; got \"\"" : ""; }

void RequireTolerance(double tolerance) {
  Require("--tolerance", tolerance, tolerance >= 1e-15 && tolerance <= 0.1, "in [1e-15, 0.1]");
}

void RequireThreads(const std::optional<int>& threads) {
  if (threads) Require("--threads", *threads, *threads >= 0 && *threads <= 1024, "from 0 to 1024");
}

void RequireTime(const char* option, const std::optional<double>& seconds) {
  if (seconds) Require(option, *seconds, *seconds > 0 && *seconds <= kLongestRun, "in (0, 1e6] s");
}

void ReadDecimals(CLI::App* command) {
  const auto drop_zeros = [](std::string& text) {
    const size_t sign = text.starts_with('-') ? 1 : 0, digit = std::min(text.find_first_not_of('0', sign), text.size());
    if (text.size() > sign + 1 && text.find_first_not_of("0123456789", sign) == std::string::npos)
      text.erase(sign, std::min(digit, text.size() - 1) - sign);
    return std::string();
  };
  for (CLI::Option* const option : command->get_options())
    if (const std::string type = option->get_type_name(); type == "N" || type == "K" || type.starts_with("N,"))
      option->transform(CLI::Validator(drop_zeros, ""));
}

CLI::Option* AddTime(CLI::App* command, const char* name, std::optional<double>* target, const char* help) {
  const auto parse = [name, target](const std::string& text) { *target = ParseSeconds(name, text); };
  return command->add_option_function<std::string>(name, parse, help)->type_name("S");
}

}  // namespace islet
