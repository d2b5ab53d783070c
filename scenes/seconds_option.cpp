#include "scenes/seconds_option.h"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>

namespace islet {
namespace {

constexpr std::uint64_t kExact = std::uint64_t{1} << 53;  // whole numbers up to here are doubles
constexpr int kMostExponent = 400;                        // of ten; what is beyond is no double

[[noreturn]] void Refuse(const std::string& option, std::string_view text, const char* why) {
  throw std::invalid_argument(option + ": " + why + "; got " + std::string(text));
}

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// from_chars alone would take "nan" and "inf".
std::optional<double> Decimal(std::string_view text) {
  const std::string_view digits = text.substr(text.starts_with('-') ? 1 : 0);
  if (digits.empty() || (!IsDigit(digits[0]) && digits[0] != '.')) return std::nullopt;
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// whole * 10^exponent, exactly.
struct Scaled {
  std::uint64_t whole = 0;
  int exponent = 0;
};

// Of a decimal that is none below zero; nothing if it has too many digits.
std::optional<Scaled> ScaledOf(std::string_view decimal) {
  Scaled scaled;
  bool behind_point = false;
  for (size_t i = 0; i < decimal.size(); ++i) {
    const char c = decimal[i];
    if (c == 'e' || c == 'E') {
      const size_t sign = i + 1 < decimal.size() && decimal[i + 1] == '+' ? 1 : 0;
      int exponent = 0;
      const auto [end, error] =
          std::from_chars(decimal.data() + i + 1 + sign, decimal.data() + decimal.size(), exponent);
      if (error != std::errc() || std::abs(exponent) > kMostExponent) return std::nullopt;
      scaled.exponent += exponent;
      break;
    }
    if (c == '.') {
      behind_point = true;
      continue;
    }
    scaled.whole = 10 * scaled.whole + static_cast<std::uint64_t>(c - '0');
    if (scaled.whole > kExact) return std::nullopt;
    scaled.exponent -= behind_point;
  }
  return scaled;
}

// False if the product is no exact double.
bool TimesPowerOfTen(int power, std::uint64_t* whole) {
  for (; power > 0 && *whole != 0; --power) {
    if (*whole > kExact / 10) return false;
    *whole *= 10;
  }
  return true;
}

}  // namespace

double ParseSeconds(const std::string& option, std::string_view text) {
  constexpr const char* kForm = "must be a number of seconds or a fraction of two, as 0.01 or 1/30";
  const size_t slash = text.find('/');
  if (slash == std::string_view::npos) {
    const std::optional<double> value = Decimal(text);
    if (!value) Refuse(option, text, kForm);
    return *value;
  }
  std::string_view above = text.substr(0, slash);
  const std::string_view below = text.substr(slash + 1);
  if (!Decimal(above) || !Decimal(below) || below.starts_with('-')) Refuse(option, text, kForm);
  const bool negative = above.starts_with('-');
  if (negative) above.remove_prefix(1);
  std::optional<Scaled> numerator = ScaledOf(above), denominator = ScaledOf(below);
  if (denominator && denominator->whole == 0) Refuse(option, text, "divides by zero");
  // Both whole and exact, so that the one division rounds once.
  if (!numerator || !denominator || !TimesPowerOfTen(numerator->exponent - denominator->exponent, &numerator->whole) ||
      !TimesPowerOfTen(denominator->exponent - numerator->exponent, &denominator->whole))
    Refuse(option, text, "a fraction may have 15 digits above and below its line");
  const double quotient = static_cast<double>(numerator->whole) / static_cast<double>(denominator->whole);
  return negative ? -quotient : quotient;
}

}  // namespace islet
