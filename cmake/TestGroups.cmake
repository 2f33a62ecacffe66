# Registers the tests of a GoogleTest program for ctest, up to 16 consecutive tests of a suite in one
# process: a process with a sanitizer takes longer to start than most tests take.
#
#   rtcf_test_groups(TARGET PREFIX prefix [FILTER gtest-filter] [PROPERTIES …])
#
# The tests are listed when ctest starts: a sanitized program may not run during the build.
function(rtcf_test_groups target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "PREFIX;FILTER" "PROPERTIES")
  if(NOT arg_FILTER)
    set(arg_FILTER *)
  endif()
  get_property(count TARGET ${target} PROPERTY RTCF_TEST_GROUPS)
  math(EXPR count "0${count} + 1")
  set_property(TARGET ${target} PROPERTY RTCF_TEST_GROUPS ${count})
  set(file ${CMAKE_CURRENT_BINARY_DIR}/${target}-${count}.cmake)
  file(GENERATE OUTPUT ${file} CONTENT "set(program [==[$<TARGET_FILE:${target}>]==])
set(prefix [==[${arg_PREFIX}]==])
set(filter [==[${arg_FILTER}]==])
set(properties [==[${arg_PROPERTIES}]==])
include([==[${PROJECT_SOURCE_DIR}/cmake/list-test-groups.cmake]==])
")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${file})
endfunction()
