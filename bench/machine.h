// What a CSV file of the bench tells of where it was measured.
#pragma once

#include <string>

namespace islet::bench {

// Of what a shell command prints; "unknown" if it prints nothing.
std::string FirstLineOf(const char* command);

std::string Processor();

// Load average of the last minute, one digit after the point; -1.0 if the system does not tell.
std::string Load();

}  // namespace islet::bench
