# Writes OUTPUT, a source that says which commit of SOURCE_DIR is built: run at every build, but the file is
# touched only when the answer changes. "unknown" outside of a git repository of its own.
cmake_minimum_required(VERSION 3.25)
set(commit unknown)
set(dirty false)
find_package(Git QUIET)
if(Git_FOUND)
  execute_process(COMMAND ${GIT_EXECUTABLE} rev-parse --show-toplevel HEAD WORKING_DIRECTORY ${SOURCE_DIR}
    OUTPUT_VARIABLE answer RESULT_VARIABLE failed ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT failed)
    string(REPLACE "\n" ";" answer "${answer}")
    list(GET answer 0 top)
    list(GET answer 1 head)
    file(REAL_PATH "${top}" top)
    file(REAL_PATH "${SOURCE_DIR}" here)
    # A copy without .git inside of somebody else's repository has no commit of its own.
    if(top STREQUAL here)
      set(commit ${head})
      execute_process(COMMAND ${GIT_EXECUTABLE} status --porcelain --untracked-files=no
        WORKING_DIRECTORY ${SOURCE_DIR} OUTPUT_VARIABLE changes ERROR_QUIET)
      if(NOT changes STREQUAL "")
        set(dirty true)
      endif()
    endif()
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} @ONLY CONTENT
"// Generated at every build; do not edit.
namespace kbvh::experiments {
extern const char* const built_commit;
extern const bool built_dirty;
const char* const built_commit = \"@commit@\";
const bool built_dirty = @dirty@;
}  // namespace kbvh::experiments
")
