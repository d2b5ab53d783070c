# What judges a run: no engine in it, so the tests build it too.
if(NOT TARGET islet_chart_judge)
  set(charts ${PROJECT_SOURCE_DIR}/bench/charts)
  add_library(islet_chart_judge STATIC EXCLUDE_FROM_ALL
    ${charts}/../peers/peer.cpp
    ${charts}/chart_plans.cpp
    ${charts}/chart_scenes.cpp
    ${charts}/contact_points.cpp
    ${charts}/coulomb_error.cpp
    ${charts}/judge.cpp
    ${charts}/overlap.cpp
    ${charts}/polytope.cpp)
  target_link_libraries(islet_chart_judge PUBLIC islet::scenes PRIVATE islet_flags)
endif()
