# The program islet from outside: exit status, messages, and what it writes.
#   cmake -DISLET=<program> -DSCRATCH=<folder of its own> -P tests/scenes/cli_test.cmake
cmake_minimum_required(VERSION 3.22)

file(REMOVE_RECURSE ${SCRATCH})
file(MAKE_DIRECTORY ${SCRATCH})
set(num_checks 0)

function(islet status_variable stdout_variable stderr_variable)
  execute_process(COMMAND ${ISLET} ${ARGN} WORKING_DIRECTORY ${SCRATCH}
    RESULT_VARIABLE status OUTPUT_VARIABLE stdout ERROR_VARIABLE stderr)
  set(${status_variable} "${status}" PARENT_SCOPE)
  set(${stdout_variable} "${stdout}" PARENT_SCOPE)
  set(${stderr_variable} "${stderr}" PARENT_SCOPE)
endfunction()

function(count_check)
  math(EXPR num_checks "${num_checks} + 1")
  set(num_checks ${num_checks} PARENT_SCOPE)
endfunction()

macro(check_equal what actual expected)
  count_check()
  if(NOT "${actual}" STREQUAL "${expected}")
    message(SEND_ERROR "${what}: wanted '${expected}', got '${actual}'")
  endif()
endmacro()

# Takes the name of a variable, because its text may hold any character.
macro(check_match what variable pattern)
  count_check()
  if(NOT ${variable} MATCHES "${pattern}")
    message(SEND_ERROR "${what}: wanted a match of '${pattern}', got '${${variable}}'")
  endif()
endmacro()

# Exit status 2, field and value in one line on stderr, nothing on stdout, no file left.
macro(expect_rejected field value)
  islet(status stdout stderr ${ARGN})
  check_equal("exit status of islet ${ARGN}" "${status}" 2)
  check_match("message of islet ${ARGN}" stderr "${field}[^\n]*${value}")
  check_equal("stdout of islet ${ARGN}" "${stdout}" "")
  file(GLOB left ${SCRATCH}/*)
  check_equal("files left by islet ${ARGN}" "${left}" "")
endmacro()

expect_rejected("scene" "cubeglas\".*cubeglass.*officetoy" run cubeglas --report r.json --frames-csv f.csv)
expect_rejected("commands" "walk" walk stack)
expect_rejected("not expected" "cubejam" run stack cubejam)
expect_rejected("not expected" "--speed" run stack --speed 3)
expect_rejected("--count" "-1" run stack --count -1 --report r.json --frames-csv f.csv)
expect_rejected("--count" "0" run stack --count 0)
expect_rejected("--count" "2.5" run stack --count 2.5)
expect_rejected("--count" "ten" run stack --count ten)
expect_rejected("--seed" "-7" run cubejam --seed -7)
expect_rejected("--seed" "99999999999999999999999" run cubejam --seed 99999999999999999999999)
expect_rejected("--frames" "-3" run stack --frames -3)
expect_rejected("--seconds" "nan" run stack --seconds nan)
expect_rejected("--seconds" "0" run stack --seconds 0)
expect_rejected("--frames" "--seconds" run stack --seconds 1 --frames 30)
expect_rejected("--dt" "0" run stack --dt 0 --report r.json)
expect_rejected("--dt" "-0.1" run stack --dt -0.1)
expect_rejected("--dt" "1.5" run stack --dt 1.5)
expect_rejected("--dt" "nan" run stack --dt nan)
expect_rejected("--dt" "inf" run stack --dt inf)
expect_rejected("--friction" "-0.5" run stack --friction -0.5)
expect_rejected("--friction" "nan" run stack --friction nan)
expect_rejected("--friction" "1e.300" run stack --friction 1e300)
expect_rejected("--restitution" "1.5" run stack --restitution 1.5)
expect_rejected("--restitution" "-0.25" run stack --restitution -0.25)
expect_rejected("--restitution" "nan" run stack --restitution nan)
expect_rejected("--tolerance" "0" run stack --tolerance 0)
expect_rejected("--tolerance" "0.2" run stack --tolerance 0.2)
expect_rejected("--tolerance" "nan" run stack --tolerance nan)
expect_rejected("--threads" "-2" run stack --threads -2)
expect_rejected("--model" "newton" run stack --model newton)
expect_rejected("--cone" "square" run stack --cone square)
expect_rejected("--bounce" "eq7" run stack --bounce eq7)
expect_rejected("--bounce-limit" "-1" run stack --bounce-limit -1)
expect_rejected("--freeze" "deep" run stack --freeze deep)
expect_rejected("--freeze-count" "-1" run stack --freeze-count -1)
expect_rejected("--drop" "-0.5" run stack --drop -0.5)
expect_rejected("--drop" "101" run stack --drop 101)
expect_rejected("--drop" "nan" run stack --drop nan)
expect_rejected("drop" "0.25" run cubejam --drop 0.25 --report r.json)
expect_rejected("angle" "0.1" run stack --angle 0.1)
expect_rejected("incoming" "5" run officetoy --incoming 5)
expect_rejected("--report" "nowhere/r.json" run stack --report ${SCRATCH}/nowhere/r.json)
expect_rejected("--report" "is a directory" run stack --report ${SCRATCH})
expect_rejected("--frames-csv" "nowhere/f.csv" run stack --report r.json --frames-csv nowhere/f.csv)
expect_rejected("same file" "r.json" run stack --report r.json --frames-csv ./r.json)

# An older report survives a run that was refused.
file(WRITE ${SCRATCH}/old.json "old")
islet(status stdout stderr run stack --dt 0 --report old.json)
file(READ ${SCRATCH}/old.json old)
check_equal("an older report" "${old}" "old")
file(REMOVE ${SCRATCH}/old.json)

# The list.
islet(status stdout stderr scenes)
check_equal("exit status of islet scenes" "${status}" 0)
foreach(scene stack cubejam csstack cubeglass cubeglass7 sphereglass officetoy balance revival manystacks)
  check_match("islet scenes" stdout "(^|\n)${scene} ")
endforeach()

# The report has every key, and the table one row per frame.
islet(status stdout stderr run stack --count 3 --frames 5 --report r.json --frames-csv f.csv --picture p.svg)
check_equal("exit status of islet run stack (${stderr})" "${status}" 0)
file(READ ${SCRATCH}/r.json report)
foreach(key scene bodies frames dt threads model cone tolerance freeze seed sim_seconds wall_seconds
    ms_per_frame.mean ms_per_frame.median ms_per_frame.p99 ms_per_frame.max
    stage_seconds.detect stage_seconds.islands stage_seconds.pq stage_seconds.collision_qp stage_seconds.static_qp
    stage_seconds.freeze stage_seconds.move
    contacts.mean contacts.max active_contacts.mean active_contacts.max islands.mean islands.max
    largest_island_contacts.mean largest_island_contacts.max frozen awake
    collision_qp.solved collision_qp.seconds_mean collision_qp.iterations_mean collision_qp.iterations_max
    collision_qp.failed static_qp.solved static_qp.seconds_mean static_qp.iterations_mean static_qp.iterations_max
    static_qp.failed certificate.momentum certificate.cone certificate.dual certificate.gap
    certificate.natural_map_max certificate.natural_map_rms certificate.coulomb_map_max certificate.coulomb_map_rms
    penetration.max penetration.mean_of_frame_max kinetic_energy_end energy_gain_max momentum_drift escaped passed
    state_hash)
  string(REPLACE "." ";" path ${key})
  string(JSON value ERROR_VARIABLE error GET "${report}" ${path})
  check_equal("${key} in the report" "${error}" "NOTFOUND")
endforeach()
string(JSON value GET "${report}" frames)
check_equal("frames" "${value}" 5)
string(JSON value GET "${report}" bodies)
check_equal("bodies" "${value}" 3)
string(JSON value GET "${report}" model)
check_equal("default model" "${value}" "coulomb")
string(JSON value GET "${report}" state_hash)
check_match("hash" value "^[0-9a-f]+$")
string(LENGTH "${value}" length)
check_equal("digits of the hash" "${length}" 16)

file(STRINGS ${SCRATCH}/f.csv rows)
list(LENGTH rows num_rows)
check_equal("lines of the table" "${num_rows}" 6)
list(GET rows 0 header)
check_match("columns" header "^frame,contacts,active_contacts,islands,largest_island_contacts,\
collision_qp_seconds,static_qp_seconds,iterations,awake,kinetic_energy,penetration_max")
string(REGEX REPLACE "[^,]" "" commas "${header}")
foreach(row IN LISTS rows)
  string(REGEX REPLACE "[^,]" "" row_commas "${row}")
  check_equal("cells of ${row}" "${row_commas}" "${commas}")
endforeach()
file(READ ${SCRATCH}/p.svg picture LIMIT 100)
check_match("picture" picture "^<svg ")
file(GLOB left RELATIVE ${SCRATCH} ${SCRATCH}/*)
check_equal("files written" "${left}" "f.csv;p.svg;r.json")

# A picture alone, of the start.
islet(status stdout stderr run csstack --frames 1 --picture start.svg --picture-time 0)
check_equal("exit status of a run with a picture (${stderr})" "${status}" 0)
file(READ ${SCRATCH}/start.svg picture)
string(REGEX MATCHALL "<circle " circles "${picture}")
list(LENGTH circles num_circles)
check_equal("spheres drawn" "${num_circles}" 5)

# With "-" the standard output is the JSON object alone.
islet(status stdout stderr run officetoy --frames 3 --report -)
string(JSON value ERROR_VARIABLE error GET "${stdout}" scene)
check_equal("scene in the JSON on stdout" "${value}" "officetoy")
check_match("summary on stderr" stderr "state hash")

# --paper, and what overrides it wherever it stands.
islet(status stdout stderr run stack --cone circular --frames 1 --paper --report -)
foreach(pair model=kinetic cone=circular bounce=eq5 freeze=paper)
  string(REPLACE "=" ";" pair ${pair})
  list(GET pair 0 key)
  list(GET pair 1 wanted)
  string(JSON value GET "${stdout}" ${key})
  check_equal("${key} of --cone circular --paper" "${value}" "${wanted}")
endforeach()

# The same bits with one thread and with two, and others from another seed.
foreach(scene IN ITEMS stack cubejam csstack "cubeglass;--count;100" "cubeglass7;--count;100" "sphereglass;--count;100"
    officetoy balance revival "manystacks;--count;8")
  islet(status stdout stderr run ${scene} --frames 70 --threads 1 --report -)
  string(JSON one ERROR_VARIABLE error GET "${stdout}" state_hash)
  islet(status stdout stderr run ${scene} --frames 70 --threads 2 --report -)
  string(JSON two ERROR_VARIABLE error GET "${stdout}" state_hash)
  check_match("hash of ${scene}" one "^[0-9a-f]+$")
  check_equal("hash of ${scene} with two threads" "${two}" "${one}")
endforeach()
islet(status stdout stderr run csstack --frames 2 --seed 11 --report -)
string(JSON one GET "${stdout}" state_hash)
islet(status stdout stderr run csstack --frames 2 --seed 12 --report -)
string(JSON two GET "${stdout}" state_hash)
count_check()
if(one STREQUAL two)
  message(SEND_ERROR "another seed, the same end: ${one}")
endif()

file(REMOVE_RECURSE ${SCRATCH})
message(STATUS "${num_checks} checks")
