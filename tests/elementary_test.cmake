# Fails where engine or qp asks the C library for a function whose last bits differ between machines: sines and the like are those of
# qp/elementary.h, and a length is a square root, which is rounded alike everywhere.
#   cmake -DROOT=<repository> -P tests/elementary_test.cmake
cmake_minimum_required(VERSION 3.22)

set(num_files 0)
set(errors "")
file(GLOB_RECURSE files RELATIVE ${ROOT} ${ROOT}/engine/*.h ${ROOT}/engine/*.cpp ${ROOT}/qp/*.h ${ROOT}/qp/*.cpp)
foreach(file IN LISTS files)
  math(EXPR num_files "${num_files} + 1")
  file(STRINGS ${ROOT}/${file} lines
    REGEX "std::(sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot)\\(")
  foreach(line IN LISTS lines)
    string(APPEND errors "\n  ${file}: ${line}")
  endforeach()
endforeach()
if(num_files EQUAL 0)
  message(FATAL_ERROR "no source below '${ROOT}': nothing was checked")
endif()
if(errors)
  message(FATAL_ERROR "other machines would have other bits:${errors}")
endif()
message(STATUS "${num_files} files ask for nothing that the machine decides")
