# The bundle that is kept belongs to the sources beside it: their hash stands in it. Needs no npm.
#   cmake -DVIEWER=scenes/viewer -P tests/scenes/viewer/bundle_test.cmake
execute_process(COMMAND ${CMAKE_COMMAND} -P ${VIEWER}/sources_hash.cmake OUTPUT_VARIABLE hash OUTPUT_STRIP_TRAILING_WHITESPACE)
file(READ ${VIEWER}/bundle/page.html page LIMIT 2000)
if(NOT page MATCHES "sources ([0-9a-f]+)\\.")
  message(FATAL_ERROR "bundle/page.html does not tell the hash of its sources")
endif()
set(kept ${CMAKE_MATCH_1})
if(NOT kept STREQUAL hash)
  message(FATAL_ERROR "bundle/page.html was made of other sources: ${kept}, now ${hash}. Build the target `viewer`")
endif()
if(NOT page MATCHES "three.js authors")
  message(FATAL_ERROR "bundle/page.html lacks the licence of three.js")
endif()
