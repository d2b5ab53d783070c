#include "scenes/terminal_line.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "scenes/output_file.h"

namespace islet {
namespace {

constexpr size_t kUsualWidth = 80, kWidest = 1000;

}  // namespace

TerminalLine::TerminalLine() : terminal_(::isatty(STDERR_FILENO) != 0) {}

size_t TerminalLine::width() const {
  size_t columns = 0;
  if (const char* const text = std::getenv("COLUMNS")) {
    const auto [end, error] = std::from_chars(text, text + std::strlen(text), columns);
    if (error != std::errc() || *end != '\0') columns = 0;
  }
  winsize size = {};
  if (columns == 0 && ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0) columns = size.ws_col;
  if (columns == 0 || columns > kWidest) columns = kUsualWidth;
  return columns - 1;  // in its last column a terminal may begin a new line
}

void TerminalLine::Show(std::string text) {
  if (!terminal_) return;
  const size_t columns = width();
  text.resize(std::min(text.size(), columns));
  const size_t length = text.size();
  if (length < shown_) text.append(std::min(shown_, columns) - length, ' ');
  Print(stderr, "\r" + text);
  shown_ = length;
}

void TerminalLine::Clear() {
  if (!terminal_ || shown_ == 0) return;
  Show("");
  Print(stderr, "\r");
}

void TerminalLine::End() {
  if (terminal_ && shown_ > 0) Print(stderr, "\n");
  shown_ = 0;
}

}  // namespace islet
