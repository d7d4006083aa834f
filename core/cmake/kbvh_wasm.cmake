# WebAssembly by Emscripten: exceptions of the machine, and Boost's and JSON's headers in a folder of their own, because
# the folder of the system's headers would hide those of Emscripten.
add_compile_options(-fwasm-exceptions)
add_link_options(-fwasm-exceptions)
foreach(library boost/version.hpp nlohmann/json.hpp)
  cmake_path(GET library PARENT_PATH folder)
  find_path(KBVH_HOST_${folder} ${library} PATHS /usr/include /usr/local/include NO_CMAKE_FIND_ROOT_PATH)
  mark_as_advanced(KBVH_HOST_${folder})
  if(NOT KBVH_HOST_${folder})
    message(FATAL_ERROR "${library} was not found (Debian: libboost-dev, nlohmann-json3-dev)")
  endif()
  file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/headers)
  file(CREATE_LINK ${KBVH_HOST_${folder}}/${folder} ${CMAKE_BINARY_DIR}/headers/${folder} SYMBOLIC)
endforeach()
set(Boost_INCLUDE_DIR ${CMAKE_BINARY_DIR}/headers CACHE PATH "" FORCE)
# Eigen's headers have a folder of their own already.
find_package(Eigen3 3.4 REQUIRED NO_MODULE PATHS /usr /usr/local NO_CMAKE_FIND_ROOT_PATH)
