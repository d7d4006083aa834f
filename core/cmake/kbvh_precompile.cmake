# With KBVH_PRECOMPILE, the headers that nearly every source includes are read once: the standard library, integers of any
# length and, for the program, JSON. They take half of the time of a short file. The option is for builds that are tested:
# GCC then generates other machine code for a few functions, and times would have to be compared again. Every source still names what it needs, and
# headers are tested without (headers_self_contained).
option(KBVH_PRECOMPILE "Precompile the headers of the standard library, Boost and JSON: faster builds" OFF)

set(kbvh_precompiled_core
  <algorithm> <array> <bit> <cmath> <cstdint> <filesystem> <functional> <limits> <map> <memory> <numeric> <optional> <set>
  <span> <stdexcept> <string> <utility> <vector> <boost/multiprecision/cpp_int.hpp>)
set(kbvh_precompiled_program ${kbvh_precompiled_core} <nlohmann/json.hpp>)

# kbvh_precompile(TARGET core|program [option...]): the options are those beyond the flags of the build with which TARGET
# is compiled.
function(kbvh_precompile target kind)
  if(NOT KBVH_PRECOMPILE)
    return()
  endif()
  string(MAKE_C_IDENTIFIER "kbvh_precompiled_${kind}${ARGN}" owner)
  if(NOT TARGET ${owner})
    set(source ${CMAKE_BINARY_DIR}/precompiled/${owner}.cpp)
    if(NOT EXISTS ${source})
      file(WRITE ${source} "")
    endif()
    add_library(${owner} OBJECT ${source})
    target_precompile_headers(${owner} PRIVATE ${kbvh_precompiled_${kind}})
    target_compile_options(${owner} PRIVATE ${ARGN})
    target_link_libraries(${owner} PRIVATE kbvh_flags kbvh_warnings)
    target_include_directories(${owner} SYSTEM PRIVATE ${kbvh_boost_headers})
    if(kind STREQUAL "program")
      target_link_libraries(${owner} PRIVATE nlohmann_json::nlohmann_json)
    endif()
  endif()
  target_precompile_headers(${target} REUSE_FROM ${owner})
endfunction()
