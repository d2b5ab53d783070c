// The manual page islet(1), made of the definitions of the commands.
//
//   out: troff, as `man -l` reads it
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace islet {

std::string Manual(const CLI::App& program, const std::string& version);

}  // namespace islet
