#include "scenes/printable.h"

#include <string_view>

namespace islet {
namespace {

// [bytes] of the character that the text begins with; 0 if it is none of UTF-8.
size_t CharacterBytes(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(i < text.size() ? text[i] : 0); };
  const unsigned char first = byte(0);
  if (first < 0x80) return 1;
  const size_t bytes = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4) return 0;
  for (size_t i = 1; i < bytes; ++i)
    if ((byte(i) & 0xc0) != 0x80) return 0;
  // Longer than they need be, halves of UTF-16, and beyond the last character.
  const unsigned char second = byte(1);
  const bool wrong = (first == 0xe0 && second < 0xa0) || (first == 0xed && second >= 0xa0) ||
                     (first == 0xf0 && second < 0x90) || (first == 0xf4 && second >= 0x90);
  return wrong ? 0 : bytes;
}

}  // namespace

std::string Printable(const std::string& text) {
  std::string printable;
  for (size_t i = 0; i < text.size();) {
    const size_t bytes = CharacterBytes(std::string_view(text).substr(i));
    const auto first = static_cast<unsigned char>(text[i]);
    const bool control =
        first < 0x20 || first == 0x7f || (first == 0xc2 && static_cast<unsigned char>(text[i + 1]) < 0xa0);
    if (bytes == 0 || control)
      printable += '?';
    else
      printable.append(text, i, bytes);
    i += bytes == 0 ? 1 : bytes;
  }
  return printable;
}

}  // namespace islet
