# Compiles the headers of core on their own. If their includes have changed since the build was configured, the chains of
# header_chains.py may be out of date, and it is configured again.
execute_process(COMMAND /usr/bin/python3 ${CMAKE_CURRENT_LIST_DIR}/header_chains.py ${SOURCE_DIR} ${FOLDERS}
  OUTPUT_VARIABLE now COMMAND_ERROR_IS_FATAL ANY)
file(READ ${CHAINS} configured)
if(NOT now STREQUAL configured)
  execute_process(COMMAND ${CMAKE_COMMAND} ${BUILD_DIR} COMMAND_ERROR_IS_FATAL ANY)
endif()
execute_process(COMMAND ${CMAKE_COMMAND} --build ${BUILD_DIR} --target headers_self_contained_test COMMAND_ERROR_IS_FATAL ANY)
