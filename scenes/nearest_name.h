// Of some names the one that a user may have meant: it differs in the fewest letters, the first of equals.
//   cost: in proportion to the lengths of both; of what is longer than 100 letters only these are looked at
//   threads: pure
#pragma once

#include <span>
#include <string_view>

namespace islet {

// Number of single-letter insertions, removals and changes that turn a into b.
int EditDistance(std::string_view a, std::string_view b);

std::string_view NearestName(std::string_view name, std::span<const char* const> names);  // empty: there are none

}  // namespace islet
