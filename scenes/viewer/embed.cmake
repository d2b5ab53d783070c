# Writes a C++ source that holds a text file, so that the program needs no file beside it.
#   cmake -DTEXT=bundle/page.html -DSOURCE=out.cpp -P embed.cmake
file(READ ${TEXT} text)
string(FIND "${text}" ")islet_page\"" end)
if(NOT end EQUAL -1 OR NOT text MATCHES "<!--islet:data-->")
  message(FATAL_ERROR "${TEXT} is no page of the viewer")
endif()
file(WRITE ${SOURCE} "#include \"scenes/viewer/bundle.h\"

#include <string_view>

#pragma GCC diagnostic ignored \"-Woverlength-strings\"

namespace islet {

std::string_view ViewerPage() {
  using namespace std::string_view_literals;
  return R\"islet_page(${text})islet_page\"sv;
}

}  // namespace islet
")
