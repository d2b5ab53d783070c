# Counts the thresholds of engine and qp: named numbers that somebody chose, and that could be others. Prints how many each room has, and fails
# where there are more than before: who adds one takes one away, or shows in bench/notebook.md what a user would lose without it and raises MOST.
#   cmake -DROOT=<repository> -P tests/thresholds_test.cmake
cmake_minimum_required(VERSION 3.22)
set(MOST 123)

# Not counted: numbers that are what they are. Each name is of one thing alone, and has to be there.
set(FACTS
  kLanes kTile kParts kColumns kSpill kVector kRowLanes kBatchLanes  # widths of vectors, and what follows from them
  kKinds kSpare kFaces kMaxRows kNumProblemRungs kNumRungs kCorners kEdges kSigns kMotionBytes kMostSums  # sizes and lists
  kNobody kClosestFeature kTouchingEdges kAutoBounceLimit kAwake kBefore kNow kWall kFar kVersion  # marks
  kBrief kTouching kGain  # shares of others that are counted
  kOuter kShare kShares  # coefficients of integrators
  kUlp kHalvings kMostSteps kMostTasks)  # bits: rounding of a double, what halving an interval leaves, a word of marks

set(sum 0)
set(facts 0)
file(GLOB_RECURSE files RELATIVE ${ROOT} ${ROOT}/engine/*.h ${ROOT}/engine/*.cpp ${ROOT}/qp/*.h ${ROOT}/qp/*.cpp)
foreach(file IN LISTS files)
  file(STRINGS ${ROOT}/${file} lines
    REGEX "^ *(static |inline )*constexpr (static )?(double|float|int|size_t|std::size_t|std::u?int[0-9]+_t|auto) k[A-Z][A-Za-z0-9]*(\\[.*\\])? *(=|\\{)")
  get_filename_component(room ${file} DIRECTORY)
  string(REPLACE "/" "_" key ${room})
  string(REGEX REPLACE "//[^;]*" "" lines "${lines}")
  string(REGEX MATCHALL "k[A-Z][A-Za-z0-9]*(\\[[^]]*\\])? *[={]" names "${lines}")  # a line may name several
  foreach(name IN LISTS names)
    string(REGEX REPLACE "[^A-Za-z0-9].*" "" name "${name}")
    if(name IN_LIST FACTS)
      math(EXPR facts "${facts} + 1")
      list(APPEND found ${name})
      continue()
    endif()
    if(NOT DEFINED room_${key})
      set(room_${key} 0)
      list(APPEND rooms ${room})
    endif()
    math(EXPR room_${key} "${room_${key}} + 1")
    math(EXPR sum "${sum} + 1")
  endforeach()
endforeach()
foreach(fact IN LISTS FACTS)
  if(NOT fact IN_LIST found)
    message(FATAL_ERROR "no constant is named ${fact}: take it off FACTS")
  endif()
endforeach()
foreach(room IN LISTS rooms)
  string(REPLACE "/" "_" key ${room})
  message(STATUS "${room_${key}} ${room}")
endforeach()
if(sum EQUAL 0)
  message(FATAL_ERROR "no threshold found below '${ROOT}': nothing was counted")
endif()
message(STATUS "${sum} thresholds, at most ${MOST}; beside them ${facts} facts")
if(sum GREATER MOST)
  message(FATAL_ERROR "${sum} thresholds are more than ${MOST}")
endif()
