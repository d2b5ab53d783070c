// Text of others, as it may stand in a message: no control character of it steers a terminal.
//
//   out: the same with '?' for each control character (also those of two bytes, C2 80 to C2 9F) and each byte that is no UTF-8
//   threads: pure function
#pragma once

#include <string>

namespace islet {

std::string Printable(const std::string& text);

}  // namespace islet
