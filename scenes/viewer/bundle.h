// The viewer's page without a film: scenes/viewer/bundle/page.html, built into the program by embed.cmake. Where the data goes it
// says kDataMark.
#pragma once

#include <string_view>

namespace islet {

inline constexpr std::string_view kDataMark = "<!--islet:data-->";

std::string_view ViewerPage();

}  // namespace islet
