// One line of the terminal behind the standard error output that is written over and over: how far something is.
//
//   - No escape codes: a shorter text is filled up with blanks.
//   - Where the standard error output is no terminal nothing is written.
//   threads: one caller at a time
#pragma once

#include <cstddef>
#include <string>

namespace islet {

class TerminalLine {
 public:
  TerminalLine();
  bool on_terminal() const { return terminal_; }

  // Characters that fit without a line break: of COLUMNS if it is a number, of the terminal, or 79.
  size_t width() const;

  void Show(std::string text);  // in place of what is there, cut to the width
  void Clear();                 // blank, for other output
  void End();                   // what is there stays, and the next text begins a new line

 private:
  bool terminal_;
  size_t shown_ = 0;  // characters on the line
};

}  // namespace islet
