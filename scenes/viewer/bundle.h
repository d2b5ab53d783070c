// The viewer's page without a film: scenes/viewer/bundle/page.html, built into the program by embed.cmake. Where the data goes it
// says <!--islet:data-->.
#pragma once

#include <string_view>

namespace islet {

std::string_view ViewerPage();

}  // namespace islet
