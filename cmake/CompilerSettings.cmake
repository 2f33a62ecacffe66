# Warnings and sanitizers of our own code. Components built outside this tree get neither.
add_library(rtcf_compiler_settings INTERFACE)
target_compile_options(rtcf_compiler_settings INTERFACE -Wall -Wextra -Wconversion)
# The batches of trees with sanitizers have more files, whose names shadow those of others.
if(NOT RTCF_SANITIZE)
  target_compile_options(rtcf_compiler_settings INTERFACE -Wshadow)
endif()
# Warnings are errors with GCC only, and without sanitizers, whose instrumentation confuses its
# analysis. The warnings of other compilers change with each version.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT RTCF_SANITIZE)
  target_compile_options(rtcf_compiler_settings INTERFACE -Werror)
endif()

# The flags of dpkg remove the tree's folder from the paths of sources. Those of the build folder are then
# relative to the same one, so that gdb finds the sources if it is called there.
if(CMAKE_CXX_FLAGS MATCHES "-ffile-prefix-map=")
  add_compile_options(-ffile-prefix-map=${CMAKE_BINARY_DIR}=.)
endif()

# A quarter of the time to compile goes into the symbols of variables and types.
if(NOT RTCF_SYMBOLS)
  add_compile_options(-g1)
endif()

if(RTCF_SANITIZE)
  set(known thread address,undefined realtime)
  if(NOT RTCF_SANITIZE IN_LIST known)
    message(FATAL_ERROR "RTCF_SANITIZE=${RTCF_SANITIZE} is not one of: ${known}")
  endif()
  if(RTCF_SANITIZE STREQUAL "realtime" AND NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "RTCF_SANITIZE=realtime needs Clang: leave out CMAKE_CXX_COMPILER")
  endif()
  add_compile_options(-fsanitize=${RTCF_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${RTCF_SANITIZE})
  # Stack traces still have line numbers. Compiling unoptimised takes half the time; the executor
  # with RealtimeSanitizer is optimised, because it is also in a package and runs loops.
  if(RTCF_SANITIZE STREQUAL "realtime")
    add_compile_options(-O1 -g1)
  else()
    add_compile_options(-O0 -g1)
  endif()
  if(RTCF_SANITIZE MATCHES "undefined")
    # Undefined behaviour ends the test, as the findings of the other sanitizers do.
    add_compile_options(-fno-sanitize-recover=undefined)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
      add_compile_options(-fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/cmake/undefined-ignored.txt)
    endif()
  endif()
endif()

# Compiles COUNT sources of a target in one batch, because parsing headers takes most of the time.
# With RTCF_UNITY=OFF, the compiler finds files that lack an #include. With sanitizers the code is hardly
# optimised, and trees are built as a whole: larger batches pay.
function(rtcf_batches target count)
  if(RTCF_SANITIZE)
    math(EXPR count "3 * ${count}")
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${RTCF_UNITY} UNITY_BUILD_BATCH_SIZE ${count})
endfunction()
