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

# The rooms of a library, from the bottom up: room -> rooms that it may include besides the library's own folder. The headers of that folder
# include no room; its sources include any.
set(rooms_qp_linear_algebra "")
set(rooms_qp_direct "")
set(rooms_qp_gauss_seidel linear_algebra)
set(rooms_qp_interior_point linear_algebra)
set(rooms_qp_newton linear_algebra)
set(rooms_qp_dense direct newton)
set(rooms_qp_cascade direct gauss_seidel interior_point newton)
set(rooms_engine_geometry "")
set(rooms_engine_detection geometry)
set(rooms_engine_response "")
set(rooms_engine_impact response)
set(rooms_engine_freezing response)
set(rooms_engine_suite freezing impact response)
set(rooms_engine_motion detection freezing geometry impact response)
set(rooms_engine_query geometry)
set(rooms_engine_world detection freezing geometry motion query response)

# Headers of rooms that other libraries may include; of a library's own folder they may include all.
set(doors qp/cascade/island_solver.h qp/newton/least_change.h qp/dense/dense_solver.h qp/direct/one_contact.h)

# Files of the islet program, which are not in the library of scenes.
set(program "^scenes/(about|apart|completion|drawing|file_commands|main|ready_scene|run[a-z_]*|recorder|replay|effort_option|interrupt|manual|solve|view[a-z_]*|frame_log|option_checks|output_file|picture|progress|terminal_line|trace|verify/verify[a-z_]*|viewer/page_head)\\.cpp$")

# header prefix -> files that may include it, both as regular expressions. The first match decides.
set(rules
  "^(oneapi/)?tbb/"                                        "^parallel/worker_pool\\.cpp$"
  "^(fcl|ccd|octomap)/"                                    "^engine/detection/detection\\.cpp$"
  "^suitesparse/|^(amd|camd|colamd|cholmod|SuiteSparse.*)\\.h$" "^qp/linear_algebra/ordering\\.cpp$"
  "^httplib\\.h$"                                          "^scenes/live/live_server\\.cpp$"
  "^nlohmann/"                                             "${program}|^scenes/(live/command|film/film_(file|head)|file/json_tree)\\.cpp$"
  "^assimp/"                                               "^scenes/file/mesh_file\\.cpp$"
  "^(CLI|spdlog|fmt)/"                                     "${program}|^scenes/film/film_(file|head)\\.cpp$"
  "^zstd\\.h$"                                              "^scenes/film/chunk_file\\.cpp$"
  "^tiny_gltf\\.h$"                                         "^scenes/film/film_gltf\\.cpp$"
  "^zlib\\.h$"                                              "^scenes/viewer/deflate\\.cpp$"
  "^pybind11/"                                             "^scenes/python/module\\.cpp$"
  "^hdf5\\.h$"                                             "^scenes/fclib_file\\.cpp$"
  "^cairo\\.h$"                                             "^scenes/drawing_png\\.cpp$"
  "^(unistd|fcntl)\\.h$"                                    "${program}|^scenes/export_fclib\\.cpp$"
  "^poll\\.h$"                                             "^scenes/(apart|live/live_server)\\.cpp$"
  "^sys/(prctl|wait)\\.h$"                                 "^scenes/apart\\.cpp$"
  "^sys/ioctl\\.h$"                                         "^scenes/terminal_line\\.cpp$"
  "^(unsupported/)?Eigen/"                                 "^(qp|engine|scenes)/"
  "^(immintrin|cpuid)\\.h$"                                "^(qp|engine)/[a-z0-9_/]+\\.cpp$|^qp/[a-z0-9_/]+_impl\\.h$"
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

# Whether a file may look into the room that the header is in, if it is in one.
function(check_room file header)
  if(NOT header MATCHES "^(qp|engine)/([a-z_]+)/")
    return()
  endif()
  set(library ${CMAKE_MATCH_1})
  set(room ${CMAKE_MATCH_2})
  if(NOT DEFINED rooms_${library}_${room})
    fail(${file} ${header} "a new room; say in this test what it may include")
  elseif(NOT file MATCHES "^${library}/")
    if(NOT header IN_LIST doors)
      fail(${file} ${header} "other libraries see only: ${doors}")
    endif()
  elseif(file MATCHES "^${library}/([a-z_]+)/")
    if(NOT room STREQUAL CMAKE_MATCH_1 AND NOT room IN_LIST rooms_${library}_${CMAKE_MATCH_1})
      fail(${file} ${header} "${library}/${CMAKE_MATCH_1} may include of the rooms only: ${rooms_${library}_${CMAKE_MATCH_1}}")
    endif()
  elseif(file MATCHES "\\.h$")
    fail(${file} ${header} "headers of ${library} include no room")
  endif()
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
        if(NOT CMAKE_MATCH_1 IN_LIST allowed_${folder})
          fail(${file} ${header} "${folder} may include only: ${allowed_${folder}}")
        else()
          check_room(${file} ${header})
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
