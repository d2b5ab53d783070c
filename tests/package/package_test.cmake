# Installs into an empty prefix, and builds a stranger's project against that: with every compiler at hand, static and shared, by find_package
# and by pkg-config.
#   cmake -DBUILD=<build tree> -DSCRATCH=<folder> -DSTRANGER=<its sources> -DCOMPILERS=g++;clang++ -P package_test.cmake
cmake_minimum_required(VERSION 3.22)

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${code}:\n${out}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${SCRATCH})
set(prefix ${SCRATCH}/prefix)
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
run(${prefix}/bin/islet scenes)
run(${prefix}/bin/islet check ${prefix}/share/islet/samples/seesaw.json)

# A package can be moved: no file names this machine's folders.
file(GLOB_RECURSE texts ${prefix}/include/* ${prefix}/lib/*.cmake)
foreach(text IN LISTS texts)
  file(READ ${text} content)
  if(content MATCHES "/build/|#include \"|tbb/|fcl/|amd\\.h")
    message(FATAL_ERROR "${text} holds ${CMAKE_MATCH_0}")
  endif()
endforeach()

foreach(compiler IN LISTS COMPILERS)
  foreach(kind static shared)
    cmake_path(GET compiler FILENAME name)
    set(build ${SCRATCH}/${name}-${kind})
    run(${CMAKE_COMMAND} -S ${STRANGER} -B ${build} -DCMAKE_CXX_COMPILER=${compiler} -DCMAKE_PREFIX_PATH=${prefix} -DKIND=${kind}
      -DCMAKE_BUILD_TYPE=Debug)
    run(${CMAKE_COMMAND} --build ${build})
    run(${build}/stranger)
  endforeach()
endforeach()

file(GLOB_RECURSE pc ${prefix}/*/islet.pc)
find_program(PKG_CONFIG pkg-config)
if(PKG_CONFIG)
  cmake_path(GET pc PARENT_PATH folder)
  set(ENV{PKG_CONFIG_PATH} ${folder})
  run(${PKG_CONFIG} --cflags --libs islet)
  string(STRIP "${out}" flags)
  separate_arguments(flags UNIX_COMMAND "${flags}")
  list(GET COMPILERS 0 compiler)
  run(${compiler} -std=c++20 ${STRANGER}/main.cpp ${flags} -o ${SCRATCH}/by_pkg_config)
  cmake_path(GET folder PARENT_PATH libraries)
  set(ENV{LD_LIBRARY_PATH} ${libraries})
  run(${SCRATCH}/by_pkg_config)
endif()

if(PYTHON)
  file(GLOB_RECURSE module ${prefix}/*/islet.*.so)
  cmake_path(GET module PARENT_PATH folder)
  set(ENV{PYTHONPATH} ${folder})
  run(${PYTHON} -c "import islet\nprint(islet.__version__, islet.__file__)")
  if(NOT out MATCHES "${prefix}")
    message(FATAL_ERROR "python imports islet from ${out}")
  endif()
endif()

# An unknown component is refused with its name.
execute_process(COMMAND ${CMAKE_COMMAND} -S ${STRANGER} -B ${SCRATCH}/wrong -DCMAKE_PREFIX_PATH=${prefix} -DKIND=stattic
  RESULT_VARIABLE code OUTPUT_QUIET ERROR_VARIABLE out)
if(code EQUAL 0 OR NOT out MATCHES "no component stattic")
  message(FATAL_ERROR "find_package with an unknown component: ${code}\n${out}")
endif()
