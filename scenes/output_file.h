// What the program writes: files, checked before the run, written whole or not at all; and what it prints.
//
//   - A text goes to a temporary file beside the target, which then takes the target's name in one step.
//   - What is no regular file (/dev/null, a pipe) is written directly.
//   - errors: CheckWritable throws std::invalid_argument with the option's name; WriteWhole throws std::runtime_error
//   - Print never throws, so that a full disk behind the standard output costs no file: FinishStandardOutput tells it at the end.
//   threads: one caller at a time
#pragma once

#include <cstdio>
#include <string>

namespace islet {

// Leaves no trace: an existing file keeps its contents, a missing one is not made.
void CheckWritable(const std::string& option, const std::string& path);

void WriteWhole(const std::string& path, const std::string& text);

bool SameOutput(const std::string& a, const std::string& b);

// To stdout or stderr, at once. False if it could not be written, now or before.
bool Print(std::FILE* stream, const std::string& text);

// Throws std::runtime_error if anything printed to stdout did not arrive. A closed pipe must not have ended the process before:
// the program ignores SIGPIPE.
void FinishStandardOutput();

}  // namespace islet
