# Makes the reference, looks into it, and proves that a declaration without a comment fails.
#   cmake -DBUILD=<build tree> -DDOXYGEN=<program> -DSCRATCH=<folder> -P tests/package/reference_test.cmake
cmake_minimum_required(VERSION 3.22)

execute_process(COMMAND ${CMAKE_COMMAND} --build ${BUILD} --target reference RESULT_VARIABLE status)
if(status)
  message(FATAL_ERROR "Doxygen warns")
endif()

# page -> text, as regular expression: comments stand at what they tell of.
set(html ${BUILD}/reference/html)
foreach(expected
    "index.html;>Plugging in<"
    "classislet_1_1World.html;>Step<.*Advances by dt &gt; 0 .s."
    "classislet_1_1World.html;>SetForce<[^\n]*\n[^\n]*stays until changed"
    "classislet_1_1World.html;Detailed Description.*The front door.*<b>threads</b>: one caller"
    "structislet_1_1Body.html;>radius<[^\n]*\n[^\n]*.m. farthest point of the body"
    "structislet_1_1Material.html;>friction<[^\n]*\n[^\n]*mu in .0, 1e4., epsilon.*>restitution<[^\n]*\n[^\n]*mu in .0, 1e4., epsilon"
    "structislet_1_1Settings.html;>tolerance<[^\n]*\n[^\n]*>Of the contact problems"
    "namespaceislet.html;kKinematic.*moved by the user")
  list(GET expected 0 page)
  list(GET expected 1 text)
  file(READ ${html}/${page} found)
  if(NOT found MATCHES "${text}")
    message(SEND_ERROR "${page} lacks ${text}")
  endif()
endforeach()
file(GLOB pages ${html}/*.html)
foreach(page IN LISTS pages)
  file(STRINGS ${page} private REGEX "impl_|Impl[^a-z]|bits_|data_|ShapeData|Internal")
  if(private)
    message(SEND_ERROR "${page} shows what is private: ${private}")
  endif()
endforeach()

# The same settings, and a header of which one member is told of.
file(READ ${BUILD}/engine/package/Doxyfile.reference settings)
foreach(comment "// [m]" "")
  file(WRITE ${SCRATCH}/probe.h "// A file.\n#pragma once\n\n// A class.\nstruct Probe {\n  int told = 0;  // [m]\n  int other = 0;  ${comment}\n};\n")
  file(WRITE ${SCRATCH}/Doxyfile "${settings}\nINPUT = ${SCRATCH}/probe.h\nUSE_MDFILE_AS_MAINPAGE =\nOUTPUT_DIRECTORY = ${SCRATCH}\n")
  execute_process(COMMAND ${DOXYGEN} ${SCRATCH}/Doxyfile RESULT_VARIABLE status ERROR_VARIABLE said)
  if(comment AND status)
    message(SEND_ERROR "a header that is documented fails: ${said}")
  elseif(NOT comment AND NOT (status AND said MATCHES "probe.h:7: .*other"))
    message(SEND_ERROR "a member without a comment passes: ${said}")
  endif()
endforeach()
