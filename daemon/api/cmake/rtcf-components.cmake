# rtcf_add_components(<target> PACKAGE <package> SOURCES <file>... [LINK <library>...])
#
# Builds a shared library of components. It is put where a daemon run from this
# build tree with `--path <build>/lib/rtcf` finds it, and is installed to
# <libdir>/rtcf/<package>, where the system daemon looks.
include(GNUInstallDirs)

function(rtcf_add_components target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "PACKAGE" "SOURCES;LINK")
  if(NOT arg_PACKAGE OR NOT arg_SOURCES)
    message(FATAL_ERROR "rtcf_add_components(${target}): PACKAGE and SOURCES are required")
  endif()
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "rtcf_add_components(${target}): unknown arguments ${arg_UNPARSED_ARGUMENTS}")
  endif()

  add_library(${target} MODULE ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE rtcf::rtcf ${arg_LINK})
  set_target_properties(
    ${target}
    PROPERTIES PREFIX ""
               CXX_VISIBILITY_PRESET hidden
               VISIBILITY_INLINES_HIDDEN ON
               LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib/rtcf/${arg_PACKAGE})
  # A unique symbol would be shared between an old and a new build of the same
  # library in one process.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -fno-gnu-unique)
  endif()
  # A missing symbol is an error here and not when the component is loaded; a
  # sanitizer's run time is the exception, as the executor brings it.
  get_target_property(options ${target} COMPILE_OPTIONS)
  get_directory_property(directory_options COMPILE_OPTIONS)
  if(NOT "${options};${directory_options};${CMAKE_CXX_FLAGS}" MATCHES "-fsanitize")
    target_link_options(${target} PRIVATE -Wl,--no-undefined)
  endif()
  install(TARGETS ${target} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/rtcf/${arg_PACKAGE}
                                    COMPONENT ${arg_PACKAGE})
endfunction()
