// A time as it is typed: a decimal ("0.01", "1e-3") or a fraction of two decimals ("1/30", "0.5/60").
//
//   in: text     out: [s], the double that is nearest to the number meant: it is rounded once
//   errors: std::invalid_argument that names the option and the text
//   threads: pure function
#pragma once

#include <string>
#include <string_view>

namespace islet {

// Finite, of any sign: what range it must lie in is the caller's to say.
double ParseSeconds(const std::string& option, std::string_view text);

}  // namespace islet
