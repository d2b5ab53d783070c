# Reads every #include of the five libraries and fails on a wrong arrow or on a third-party header outside its one file.
#   cmake -DROOT=<repository> -P tests/layering_test.cmake
# The compiler cannot do this: on Debian the third-party headers lie in /usr/include and are found without linking.
cmake_minimum_required(VERSION 3.22)

# folder -> folders that it may include
set(allowed_qp qp parallel)
set(allowed_islands islands)
set(allowed_parallel parallel)
set(allowed_engine qp islands parallel engine)
set(allowed_scenes qp parallel engine scenes)
set(folders qp islands parallel engine scenes)

# single headers that a folder may include besides
set(also_qp "islands/disjoint_sets.h")

# Files of the islet program, which are not in the library of scenes.
set(program "^scenes/(main|run[a-z_]*|effort_option|solve|frame_log|output_file|picture|progress|verify/verify[a-z_]*)\\.cpp$")

# header prefix -> files that may include it, both as regular expressions. The first match decides.
set(rules
  "^(oneapi/)?tbb/"                                        "^parallel/worker_pool\\.cpp$"
  "^(fcl|ccd|octomap)/"                                    "^engine/detection\\.cpp$"
  "^suitesparse/|^(amd|camd|colamd|cholmod|SuiteSparse.*)\\.h$" "^qp/ordering\\.cpp$"
  "^(CLI|nlohmann|spdlog|fmt)/"                            "${program}"
  "^hdf5\\.h$"                                             "^scenes/fclib_file\\.cpp$"
  "^unistd\\.h$"                                           "${program}|^scenes/(fclib_file|export_fclib)\\.cpp$"
  "^(unsupported/)?Eigen/"                                 "^(qp|engine|scenes)/"
  "^(immintrin|cpuid)\\.h$"                                "^(qp|engine)/[a-z0-9_]+\\.cpp$|^qp/[a-z0-9_]+_impl\\.h$"
  "^[a-z_]+$"                                              ".*")  # the C++ standard library: no dot, no folder

set(errors "")
set(num_files 0)
set(num_includes 0)

function(fail file header why)
  set(errors "${errors}\n  ${file} includes ${header}: ${why}" PARENT_SCOPE)
endfunction()

function(check_third_party file header)
  list(LENGTH rules num_entries)
  math(EXPR last "${num_entries} - 2")
  foreach(i RANGE 0 ${last} 2)
    math(EXPR j "${i} + 1")
    list(GET rules ${i} header_pattern)
    list(GET rules ${j} file_pattern)
    if(header MATCHES "${header_pattern}")
      if(NOT file MATCHES "${file_pattern}")
        fail(${file} ${header} "allowed only in ${file_pattern}")
      endif()
      set(errors "${errors}" PARENT_SCOPE)
      return()
    endif()
  endforeach()
  fail(${file} ${header} "unknown header; project headers are written from the root, others need a rule in this test")
  set(errors "${errors}" PARENT_SCOPE)
endfunction()

foreach(folder IN LISTS folders)
  file(GLOB_RECURSE files RELATIVE ${ROOT} ${ROOT}/${folder}/*.h ${ROOT}/${folder}/*.cpp)
  foreach(file IN LISTS files)
    math(EXPR num_files "${num_files} + 1")
    file(STRINGS ${ROOT}/${file} lines REGEX "^[ \t]*#[ \t]*include")
    foreach(line IN LISTS lines)
      math(EXPR num_includes "${num_includes} + 1")
      if(NOT line MATCHES "include[ \t]*[<\"]([^>\"]+)[>\"]")
        fail(${file} "${line}" "a macro hides the header")
        continue()
      endif()
      set(header ${CMAKE_MATCH_1})
      if(header MATCHES "^(qp|islands|parallel|engine|scenes|tests|bench)/")
        if(NOT CMAKE_MATCH_1 IN_LIST allowed_${folder} AND NOT header IN_LIST also_${folder})
          fail(${file} ${header} "${folder} may include only: ${allowed_${folder}}")
        endif()
      else()
        check_third_party(${file} ${header})
      endif()
    endforeach()
  endforeach()
endforeach()

if(num_includes EQUAL 0)
  message(FATAL_ERROR "no #include line found below '${ROOT}': nothing was checked")
endif()
if(errors)
  message(FATAL_ERROR "layers are broken:${errors}")
endif()
message(STATUS "layers hold: ${num_includes} includes in ${num_files} files")
