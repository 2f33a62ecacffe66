# rtcf_add_components(<target> PACKAGE <package> SOURCES <file>... [LINK <library>...])
#
# Builds a shared library of components, in a folder that daemons search:
#   in a catkin workspace  devel/lib/rtcf-components/<package>, found by CMAKE_PREFIX_PATH
#   elsewhere              <build>/lib/rtcf/<package>, for `rtcfd --path <build>/lib/rtcf`
#   installed              <prefix>/lib/rtcf-components/<package>; if the prefix has a folder for
#                          each architecture, <libdir>/rtcf/<package>
# The folder lib/rtcf of a prefix contains the programs of the ROS package rtcf. A folder of that
# name in a workspace would hide them from rosrun and roslaunch, hence rtcf-components. Without
# CMAKE_BUILD_TYPE, the library is built as with RelWithDebInfo: a loop needs optimised code, and
# `rtcfctl check` and crash reports need line numbers.
include(GNUInstallDirs)

# Sets the folders in which a package's libraries are built and installed.
function(rtcf_places package folder destination)
  if(CATKIN_DEVEL_PREFIX)
    set(${folder} ${CATKIN_DEVEL_PREFIX}/lib/rtcf-components/${package} PARENT_SCOPE)
  else()
    set(${folder} ${CMAKE_BINARY_DIR}/lib/rtcf/${package} PARENT_SCOPE)
  endif()
  if(CMAKE_INSTALL_LIBDIR MATCHES "^lib/.")
    set(${destination} ${CMAKE_INSTALL_LIBDIR}/rtcf/${package} PARENT_SCOPE)
  else()
    set(${destination} lib/rtcf-components/${package} PARENT_SCOPE)
  endif()
endfunction()

function(rtcf_add_components target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "PACKAGE" "SOURCES;LINK")
  if(NOT arg_PACKAGE OR NOT arg_SOURCES)
    message(FATAL_ERROR "rtcf_add_components(${target}): PACKAGE and SOURCES are required")
  endif()
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "rtcf_add_components(${target}): unknown arguments ${arg_UNPARSED_ARGUMENTS}")
  endif()
  rtcf_places(${arg_PACKAGE} folder destination)

  add_library(${target} MODULE ${arg_SOURCES})
  # Not target_link_libraries(): its two signatures do not mix, and the caller may use either.
  set_property(TARGET ${target} APPEND PROPERTY LINK_LIBRARIES rtcf::rtcf ${arg_LINK})
  set_target_properties(
    ${target}
    PROPERTIES PREFIX ""
               CXX_VISIBILITY_PRESET hidden
               VISIBILITY_INLINES_HIDDEN ON
               LIBRARY_OUTPUT_DIRECTORY ${folder})
  if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    # Only for these libraries: a catkin workspace builds other packages in the same run.
    separate_arguments(optimised UNIX_COMMAND "${CMAKE_CXX_FLAGS_RELWITHDEBINFO}")
    target_compile_options(${target} PRIVATE ${optimised})
    get_property(said GLOBAL PROPERTY RTCF_BUILD_TYPE_SAID)
    if(NOT said)
      message(STATUS "rtcf: CMAKE_BUILD_TYPE is not set: components are built as with RelWithDebInfo "
                     "(${CMAKE_CXX_FLAGS_RELWITHDEBINFO})")
      set_property(GLOBAL PROPERTY RTCF_BUILD_TYPE_SAID TRUE)
    endif()
  endif()
  # One process can load an old and a new build of the same library, which must not share symbols.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -fno-gnu-unique)
  endif()
  # Makes a missing symbol an error of the build, not of the load. A sanitizer's run time is the
  # exception, because the executor provides it.
  get_target_property(options ${target} COMPILE_OPTIONS)
  get_directory_property(directory_options COMPILE_OPTIONS)
  if(NOT "${options};${directory_options};${CMAKE_CXX_FLAGS}" MATCHES "-fsanitize")
    target_link_options(${target} PRIVATE -Wl,--no-undefined)
  endif()
  install(TARGETS ${target} LIBRARY DESTINATION ${destination} COMPONENT ${arg_PACKAGE})
endfunction()

# rtcf_add_python_components(<target> PACKAGE <package> SOURCES <file.py>... [DEPENDS <file>...])
#
# The same for components written in Python, which rtcf-compile (package rtcf-python) compiles to
# machine code. DEPENDS: files of the build that the sources need before they are compiled. Files that
# they import or read are dependencies without it.
function(rtcf_add_python_components target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "PACKAGE" "SOURCES;DEPENDS")
  if(NOT arg_PACKAGE OR NOT arg_SOURCES)
    message(FATAL_ERROR "rtcf_add_python_components(${target}): PACKAGE and SOURCES are required")
  endif()
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "rtcf_add_python_components(${target}): unknown arguments ${arg_UNPARSED_ARGUMENTS}")
  endif()
  # Prefers rtcf-compile of the build tree.
  find_program(RTCF_COMPILE rtcf-compile HINTS ${rtcf_DIR}/../../bin)
  if(NOT RTCF_COMPILE)
    message(FATAL_ERROR "rtcf_add_python_components(${target}): rtcf-compile not found: sudo apt install rtcf-python")
  endif()
  rtcf_places(${arg_PACKAGE} folder destination)
  set(library ${folder}/${target}.so)
  set(compiled)
  foreach(source IN LISTS arg_SOURCES)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
    list(APPEND compiled ${source})
  endforeach()
  get_target_property(includes rtcf::rtcf INTERFACE_INCLUDE_DIRECTORIES)
  get_target_property(eigen Eigen3::Eigen INTERFACE_INCLUDE_DIRECTORIES)
  list(APPEND includes ${eigen})
  list(REMOVE_DUPLICATES includes)
  list(REMOVE_ITEM includes /usr/include)
  list(TRANSFORM includes PREPEND "-isystem ")
  list(JOIN includes " " flags)
  add_custom_command(
    OUTPUT ${library}
    COMMAND ${CMAKE_COMMAND} -E env "CXX=${CMAKE_CXX_COMPILER}" "CXXFLAGS=${CMAKE_CXX_FLAGS}"
            "RTCF_CXXFLAGS=${flags}" ${RTCF_COMPILE} ${compiled} -o ${library}
            --depfile ${CMAKE_CURRENT_BINARY_DIR}/${target}.d
    DEPENDS ${compiled} ${arg_DEPENDS} ${RTCF_COMPILE}
    DEPFILE ${CMAKE_CURRENT_BINARY_DIR}/${target}.d
    COMMENT "Compiling Python components ${target}"
    VERBATIM)
  add_custom_target(${target} ALL DEPENDS ${library})
  install(FILES ${library} DESTINATION ${destination} COMPONENT ${arg_PACKAGE})
endfunction()

# rtcf_add_python_test(<name>)
#
# Adds a test that runs pytest (python3-pytest) in the current source folder, with the Python
# modules of the rtcf that find_package(rtcf) has found: a build tree or the installed package.
function(rtcf_add_python_test name)
  add_test(
    NAME ${name}
    COMMAND /usr/bin/python3 -m pytest ${CMAKE_CURRENT_SOURCE_DIR}
    WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
  if(rtcf_PYTHON_DIR)
    set_tests_properties(
      ${name} PROPERTIES ENVIRONMENT_MODIFICATION
                         "PYTHONPATH=path_list_prepend:${rtcf_PYTHON_DIR}")
  endif()
endfunction()
