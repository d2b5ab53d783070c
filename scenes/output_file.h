// Files that the program writes: checked before the run, written whole or not at all.
//
//   - A text goes to a temporary file beside the target, which then takes the target's name in one step.
//   - What is no regular file (/dev/null, a pipe) is written directly.
//   - errors: CheckWritable throws std::invalid_argument with the option's name; WriteWhole throws std::runtime_error
#pragma once

#include <string>

namespace islet {

// Leaves no trace: an existing file keeps its contents, a missing one is not made.
void CheckWritable(const std::string& option, const std::string& path);

void WriteWhole(const std::string& path, const std::string& text);

bool SameOutput(const std::string& a, const std::string& b);

}  // namespace islet
