# Warnings and sanitizers of our own code; components built outside this tree
# get neither.
add_library(rtcf_compiler_settings INTERFACE)
target_compile_options(rtcf_compiler_settings INTERFACE -Wall -Wextra -Wconversion -Wshadow)
# One compiler is the judge, and without sanitizers, whose code confuses its
# analysis: what others warn of changes with each version.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT RTCF_SANITIZE)
  target_compile_options(rtcf_compiler_settings INTERFACE -Werror)
endif()

if(RTCF_SANITIZE)
  set(known thread address,undefined realtime)
  if(NOT RTCF_SANITIZE IN_LIST known)
    message(FATAL_ERROR "RTCF_SANITIZE=${RTCF_SANITIZE} is none of: ${known}")
  endif()
  if(RTCF_SANITIZE STREQUAL "realtime" AND NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "RTCF_SANITIZE=realtime needs -DCMAKE_CXX_COMPILER=clang++-22")
  endif()
  add_compile_options(-fsanitize=${RTCF_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${RTCF_SANITIZE})
  # Half the time to build; stacks still have their lines.
  add_compile_options(-O1 -g1)
  if(RTCF_SANITIZE MATCHES "undefined")
    # Undefined behaviour ends the test, as the other sanitizers' findings do.
    add_compile_options(-fno-sanitize-recover=undefined)
  endif()
endif()

# Compiles COUNT sources of a target as one, as headers cost most of the time. RTCF_UNITY=OFF shows
# which file lacks an #include.
function(rtcf_batches target count)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${RTCF_UNITY} UNITY_BUILD_BATCH_SIZE ${count})
endfunction()
