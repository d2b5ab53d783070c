// Numbers as text. ExactNumber: the shortest that reads back as the same bits; ShortNumber: for messages.
#pragma once

#include <charconv>
#include <string>

#include "engine/number_text.h"

namespace islet {

inline std::string ExactNumber(double value) {
  char text[32];
  return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
}

inline std::string ShortNumber(double value) { return Text(value); }

}  // namespace islet
