# Included by ctest in the files that rtcf_test_groups() writes, which set: program, prefix, filter and
# properties.
set(most 16)

execute_process(
  COMMAND ${program} --gtest_list_tests --gtest_filter=${filter}
  OUTPUT_VARIABLE output RESULT_VARIABLE status)
if(status)
  message(FATAL_ERROR "${program} --gtest_list_tests: ${status}\n${output}")
endif()

# Adds the tests of ${group}, all of ${suite}, as one.
macro(add_group)
  if(group)
    list(TRANSFORM group PREPEND ${suite})
    list(JOIN group ":" tests)
    math(EXPR number "${number} + 1")
    set(name "${prefix}${suite}${number}")
    add_test("${name}" "${program}" "--gtest_filter=${tests}")
    set_tests_properties("${name}" PROPERTIES ${properties})
    set(group)
  endif()
endmacro()

set(group)
string(REGEX MATCHALL "[^\n]+" lines "${output}")
foreach(line IN LISTS lines)
  # `  Test  # GetParam() = …`, below `Suite.  # TypeParam = …`.
  string(REGEX REPLACE " +#.*" "" line "${line}")
  if(line MATCHES "^  (.+)$")
    list(APPEND group "${CMAKE_MATCH_1}")
    list(LENGTH group length)
    if(length EQUAL most)
      add_group()
    endif()
  elseif(line MATCHES "^[^ ]+[.]$")
    add_group()
    set(suite ${line})
    set(number 0)
  endif()
endforeach()
add_group()
