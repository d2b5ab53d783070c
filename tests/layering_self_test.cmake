# Proves that layering_test.cmake can fail: writes small made-up trees into the build folder, each with one include, and
# checks the verdict on each.
#   cmake -DSCRATCH=<folder to write to> -P tests/layering_self_test.cmake
cmake_minimum_required(VERSION 3.22)

# expect(good|bad file include): the verdict on a tree of this one file
function(expect verdict file include)
  file(REMOVE_RECURSE ${SCRATCH})
  file(WRITE ${SCRATCH}/${file} "#pragma once\n#include <vector>\n#include ${include}\n")
  execute_process(COMMAND ${CMAKE_COMMAND} -DROOT=${SCRATCH} -P ${CMAKE_CURRENT_LIST_DIR}/layering_test.cmake
    RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(verdict STREQUAL "good" AND NOT result EQUAL 0)
    message(FATAL_ERROR "${include} in ${file} is allowed but was refused:\n${output}")
  endif()
  string(FIND "${output}" "${file}" named)
  if(verdict STREQUAL "bad" AND (result EQUAL 0 OR named EQUAL -1))
    message(FATAL_ERROR "${include} in ${file} is forbidden but was let through:\n${output}")
  endif()
endfunction()

expect(good engine/step.cpp "\"qp/problem.h\"")
expect(good engine/body.h "<Eigen/Core>")
expect(good engine/detection.cpp "<fcl/fcl.h>")
expect(good parallel/worker_pool.cpp "<oneapi/tbb/task_arena.h>")
expect(good qp/ordering.cpp "<amd.h>")
expect(good scenes/main.cpp "<CLI/CLI.hpp>")
expect(good scenes/run_report.cpp "<nlohmann/json.hpp>")

expect(bad qp/problem.cpp "\"engine/body.h\"")
expect(good qp/kkt.cpp "\"parallel/fork.h\"")
expect(bad qp/problem.h "\"islands/partition.h\"")
expect(bad islands/partition.cpp "\"qp/problem.h\"")
expect(bad parallel/schedule.cpp "\"islands/graph.h\"")
expect(bad engine/step.cpp "\"scenes/scene.h\"")
expect(bad engine/step.cpp "\"tests/support/no_alloc.h\"")
expect(bad scenes/stack.cpp "\"islands/partition.h\"")
expect(bad islands/graph.h "<Eigen/Core>")
expect(bad parallel/worker_pool.h "<tbb/task_arena.h>")
expect(bad engine/step.cpp "<tbb/parallel_for.h>")
expect(bad engine/detection.h "<fcl/fcl.h>")
expect(bad qp/block_cholesky.cpp "<suitesparse/amd.h>")
expect(bad qp/ordering.h "<amd.h>")
expect(bad scenes/scene.cpp "<fmt/format.h>")
expect(bad scenes/run_options.h "<CLI/CLI.hpp>")
expect(bad engine/world.h "<spdlog/spdlog.h>")
expect(bad engine/world.h "<boost/optional.hpp>")
expect(bad engine/world.cpp "\"body.h\"")
expect(bad engine/world.cpp "ISLET_HEADER")

# A tree without sources must not count as clean.
file(REMOVE_RECURSE ${SCRATCH})
file(MAKE_DIRECTORY ${SCRATCH})
execute_process(COMMAND ${CMAKE_COMMAND} -DROOT=${SCRATCH} -P ${CMAKE_CURRENT_LIST_DIR}/layering_test.cmake
  RESULT_VARIABLE result OUTPUT_QUIET ERROR_QUIET)
if(result EQUAL 0)
  message(FATAL_ERROR "an empty tree passed")
endif()
