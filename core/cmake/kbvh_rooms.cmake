# Rooms: folders of core and experiments, each a library of its own that sees the headers of the rooms it declares and
# no others.

# Instruction sets for which the kernels of a room are compiled, and chosen from at run time
# (core/kernels/kernel_set.hpp). A kernel file defines its tables in the namespace kbvh::kernels::KBVH_KERNELS and
# includes no header whose inline functions another file might share: the linker keeps one copy of each, possibly one
# that this processor cannot run.
set(KBVH_KERNEL_OPTIMISATION -O3 CACHE STRING "optimisation level of the kernels, but in Debug builds")
set(kbvh_kernel_flags_portable "")
set(kbvh_kernel_flags_sse -msse4.2)
set(kbvh_kernel_flags_avx2 -mavx2 -mfma)
set(kbvh_kernel_flags_avx512 -mavx2 -mfma -mavx512f -mavx512vl -mavx512dq -mavx512bw -mprefer-vector-width=512
  # GCC 12 warns about its own undefined registers.
  -Wno-uninitialized)
set(kbvh_kernel_sets portable)
set(KBVH_KERNELS_HERE OFF CACHE STRING
  "Compile, in addition to the portable kernels, only the widest that this processor runs, and those for SSE (ON) or not (WIDEST); OFF: all")
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  list(APPEND kbvh_kernel_sets sse avx2 avx512)
  if(KBVH_KERNELS_HERE)
    include(CheckCXXSourceCompiles)
    set(CMAKE_REQUIRED_FLAGS -march=native)
    check_cxx_source_compiles("
      #if !defined(__AVX512F__) || !defined(__AVX512VL__) || !defined(__AVX512DQ__) || !defined(__AVX512BW__)
      #error no
      #endif
      int main() {}" KBVH_RUNS_AVX512)
    check_cxx_source_compiles("
      #if !defined(__AVX2__) || !defined(__FMA__)
      #error no
      #endif
      int main() {}" KBVH_RUNS_AVX2)
    unset(CMAKE_REQUIRED_FLAGS)
    if(KBVH_RUNS_AVX512)
      set(kbvh_kernel_sets portable sse avx512)
    elseif(KBVH_RUNS_AVX2)
      set(kbvh_kernel_sets portable sse avx2)
    else()
      set(kbvh_kernel_sets portable sse)
    endif()
    if(KBVH_KERNELS_HERE STREQUAL WIDEST AND KBVH_RUNS_AVX2)
      list(REMOVE_ITEM kbvh_kernel_sets sse)
    endif()
  endif()
endif()
# KBVH_HAS_KERNELS_SSE and so on.
set(kbvh_kernel_definitions "")
foreach(set IN LISTS kbvh_kernel_sets)
  string(TOUPPER ${set} word)
  list(APPEND kbvh_kernel_definitions KBVH_HAS_KERNELS_${word})
endforeach()

set(KBVH_OUTER_OPTIMISATION "" CACHE STRING
  "optimisation level of strategies, adapters and the program around them, for builds that are not measured; empty: as all")
set(KBVH_JUDGE_OPTIMISATION "" CACHE STRING
  "optimisation level of the rooms in which a comparison with brute force spends its time; empty: as all")
set(kbvh_judging_rooms base geometry scene motion contract judge)
set(kbvh_reading_rooms base contract)  # parameters are text

# kbvh_room(NAME SOURCES file... [KERNELS file...] [USES room...]): the folder that calls it is a room, the library
# kbvh_NAME. Its headers are staged alone, under the path that #include spells, so that a file sees the rooms that its
# own room uses, those that these use in turn, and nothing else of the tree. USES lists all edges.
function(kbvh_room name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;KERNELS;USES")
  cmake_path(RELATIVE_PATH CMAKE_CURRENT_SOURCE_DIR BASE_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE path)
  set(stage ${CMAKE_BINARY_DIR}/rooms/${name})
  cmake_path(GET path PARENT_PATH folder)
  file(MAKE_DIRECTORY ${stage}/${folder})
  file(CREATE_LINK ${CMAKE_CURRENT_SOURCE_DIR} ${stage}/${path} SYMBOLIC)

  if(arg_KERNELS AND NOT arg_SOURCES)
    message(FATAL_ERROR "kbvh_room(${name}): KERNELS need SOURCES, with the file that chooses the kernels")
  endif()
  set(uses ${arg_USES})
  list(TRANSFORM uses PREPEND kbvh_)
  if(arg_SOURCES)
    add_library(kbvh_${name} STATIC ${arg_SOURCES})
    if(KBVH_UNITY)
      set_target_properties(kbvh_${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 6)
    endif()
    if(KBVH_UNITY AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      # Anonymous namespaces of sources are mistaken for those of headers.
      target_compile_options(kbvh_${name} PRIVATE -Wno-subobject-linkage)
    endif()
    set(visibility PUBLIC)
    target_link_libraries(kbvh_${name} PRIVATE $<BUILD_INTERFACE:kbvh_warnings>)
    target_compile_definitions(kbvh_${name} PRIVATE ${kbvh_kernel_definitions})
    set(kind core)
    set(optimisation "")
    if(path MATCHES "^experiments/")
      set(kind program)
      set(optimisation ${KBVH_OUTER_OPTIMISATION})
    elseif(name IN_LIST kbvh_judging_rooms)
      set(optimisation ${KBVH_JUDGE_OPTIMISATION})
    endif()
    if(path MATCHES "^core/" AND NOT name IN_LIST kbvh_reading_rooms)
      target_compile_options(kbvh_${name} PRIVATE ${KBVH_CORE_OPTIONS})
    endif()
    target_compile_options(kbvh_${name} PRIVATE ${optimisation})
    kbvh_precompile(kbvh_${name} ${kind} ${optimisation})
  else()
    add_library(kbvh_${name} INTERFACE)
    set(visibility INTERFACE)
  endif()
  add_library(kbvh::${name} ALIAS kbvh_${name})
  set_target_properties(kbvh_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(kbvh_${name} ${visibility}
    $<BUILD_INTERFACE:${stage}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/kbvh>)
  target_link_libraries(kbvh_${name} ${visibility} kbvh_flags ${uses})
  set_property(GLOBAL APPEND PROPERTY KBVH_ROOMS ${name})
  set_property(GLOBAL PROPERTY KBVH_ROOM_${name}_PATH ${path})
  set_property(GLOBAL PROPERTY KBVH_ROOM_${name}_USES ${arg_USES})

  if(NOT arg_KERNELS)
    return()
  endif()
  foreach(set IN LISTS kbvh_kernel_sets)
    add_library(kbvh_${name}_${set} OBJECT ${arg_KERNELS})
    target_include_directories(kbvh_${name}_${set} PRIVATE ${stage})
    target_link_libraries(kbvh_${name}_${set} PRIVATE kbvh_flags kbvh_warnings ${uses})
    target_compile_definitions(kbvh_${name}_${set}
      PRIVATE KBVH_KERNELS=${set} KBVH_KERNELS_${set} ${kbvh_kernel_definitions})
    target_compile_options(kbvh_${name}_${set} PRIVATE ${KBVH_CORE_OPTIONS} ${kbvh_kernel_flags_${set}}
      # Loops over the points of a node must be unrolled to stay in registers.
      $<$<NOT:$<CONFIG:Debug>>:${KBVH_KERNEL_OPTIMISATION}>)
    target_sources(kbvh_${name} PRIVATE $<TARGET_OBJECTS:kbvh_${name}_${set}>)
  endforeach()
endfunction()
