// What this program is: its version, and those of the libraries in it.
//   threads: pure function
#pragma once

#include <string>

namespace islet {

std::string Version();  // "0.1.0"

// "islet 0.1.0", then a line for the compiler, for the vector kernels that this machine runs and for each library; without the last newline.
std::string About();

}  // namespace islet
