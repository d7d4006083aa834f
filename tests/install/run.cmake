# Installs the build into a prefix of its own, then goes through what a user with a strategy of his own does:
# configure, build, ctest, list, bench. The first thing that is not as promised ends it.
cmake_minimum_required(VERSION 3.25)

set(prefix ${WORK_DIR}/prefix)
set(build ${WORK_DIR}/build)
file(REMOVE_RECURSE ${WORK_DIR})
file(MAKE_DIRECTORY ${WORK_DIR})
set(ENV{KBVH_CACHE} ${WORK_DIR}/cache)
file(MAKE_DIRECTORY ${WORK_DIR}/cache)

# step(TITLE COMMAND...): runs it, shows what it said if it fails, and leaves its output in `output`.
function(step title)
  message(STATUS "${title}")
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE errors)
  if(NOT result EQUAL 0)
    message(NOTICE "${output}\n${errors}")
    message(FATAL_ERROR "${title}: ${result}")
  endif()
  set(output "${output}" PARENT_SCOPE)
  set(errors "${errors}" PARENT_SCOPE)
endfunction()

# expect(TITLE TEXT REGEX) and refuse(TITLE TEXT REGEX)
function(expect title text regex)
  if(NOT text MATCHES "${regex}")
    message(FATAL_ERROR "${title}: nothing matches ${regex} in\n${text}")
  endif()
endfunction()
function(refuse title text regex)
  if(text MATCHES "${regex}")
    message(FATAL_ERROR "${title}: '${CMAKE_MATCH_0}' is in\n${text}")
  endif()
endfunction()

step("install" ${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${prefix})

# The package can be moved: it names neither the tree nor the build.
file(GLOB_RECURSE package_files ${prefix}/*.cmake)
foreach(file IN LISTS package_files)
  file(READ ${file} text)
  foreach(folder ${SOURCE_DIR} ${BUILD_DIR})
    string(FIND "${text}" "${folder}" position)
    if(NOT position EQUAL -1)
      message(FATAL_ERROR "${file} names ${folder}")
    endif()
  endforeach()
endforeach()

# The compiler's flags as kbvh had them, because sanitizers must agree on both sides.
string(TOUPPER "${BUILD_TYPE}" build_type)
step("configure" ${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${build} -G ${GENERATOR}
  -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${COMPILER} "-DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}"
  -DCMAKE_BUILD_TYPE=${BUILD_TYPE} "-DCMAKE_CXX_FLAGS=${FLAGS}" "-DCMAKE_CXX_FLAGS_${build_type}=${TYPE_FLAGS}"
  -DCMAKE_EXPORT_COMPILE_COMMANDS=ON)
refuse("configure" "${errors}" "Warning")

file(READ ${build}/compile_commands.json commands)
expect("flags that decide results reach consumers" "${commands}" "-ffp-contract=off")
refuse("warnings stay in kbvh" "${commands}" " -W[a-z][^ \"]*")
# The prefix lies in a build folder, and that may lie in the source folder.
refuse("consumers see the installed tree only" "${commands}" "-(I|isystem )${SOURCE_DIR}/?(core|experiments|tests)?[ \"]")

step("build" ${CMAKE_COMMAND} --build ${build} --parallel 2)
step("conformance" ${CMAKE_CTEST_COMMAND} --test-dir ${build} -j 2 --output-on-failure --no-tests=error)
expect("conformance covers the strategy" "${output}" "my_kbvh\\.Registry/Conformance[^\n]*sparse_refit")
refuse("conformance covers nothing else" "${output}" "bottom_up")
string(REGEX MATCH "[0-9]+% tests passed[^\n]*" line "${output}")
message(STATUS "  ${line}")

step("a program of one's own" ${build}/raw_arrays)
expect("a program of one's own" "${output}" "[1-9][0-9] strategies\nt = 0.5: 0 pairs\nt = 1: 1 pairs\nt = 1.5: 0 pairs")

step("positions frame by frame" ${build}/world_frames)
expect("positions frame by frame" "${output}" "frame 1: none within the cloth, none with the table\n")
expect("positions frame by frame" "${output}" "frame 4: pairs within the cloth, pairs with the table\n")
step("event by event" ${build}/world_events)
expect("event by event" "${output}" "[1-9][0-9]* events are scheduled\nt = ")
expect("event by event" "${output}" "\nevent at t = [^\n]*\n  node [0-9]+, side [0-9]: vertex [0-9]+ instead of [0-9]+\n")
expect("event by event" "${output}" "\n0 events are left\n")
step("contacts and changes of plans" ${build}/world_contacts)
expect("contacts and changes of plans" "${output}" "\ncontacts on the way down, contacts on the way up\n")

if(NOT EXISTS ${prefix}/bin/kbvh)
  message(STATUS "no program was installed: list and bench are not tried")
  return()
endif()

step("list" ${build}/my_kbvh list --json)
foreach(id sparse_refit bottom_up)
  expect("list" "${output}" "\"id\": \"${id}\"")
endforeach()
step("list of the installed program" ${prefix}/bin/kbvh list --json)
refuse("list of the installed program" "${output}" "sparse_refit")

set(scene --scene tablecloth --triangles 500 --keyframes 6 --l 3 --strategies sparse_refit,bottom_up)
step("run" ${build}/my_kbvh run ${scene} --repetitions 2)
expect("run" "${output}" "sparse_refit")
step("bench" ${build}/my_kbvh bench ${scene} --repetitions 2 --out ${WORK_DIR}/results)
expect("bench" "${output}" "sparse_refit")
message(STATUS "  what bench printed:\n${output}")
file(STRINGS ${WORK_DIR}/results/results.jsonl records REGEX "\"sparse_refit\"")
list(LENGTH records count)
if(NOT count EQUAL 1)
  message(FATAL_ERROR "bench: ${count} records of sparse_refit instead of 1")
endif()
string(JSON holds GET "${records}" verified holds)
string(JSON frames GET "${records}" verified frames)
string(JSON repetitions LENGTH "${records}" times repetitions)
if(NOT holds OR NOT frames EQUAL 16 OR NOT repetitions EQUAL 2)
  message(FATAL_ERROR "bench: holds ${holds}, ${frames} frames, ${repetitions} repetitions in\n${records}")
endif()
