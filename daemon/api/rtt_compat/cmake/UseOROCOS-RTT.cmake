# OROCOS' macros for packages written for RTCF 2021, on top of rtcf_add_components() and catkin. New
# packages call rtcf_add_components() themselves.
include_guard(DIRECTORY)
find_package(rtcf REQUIRED CONFIG)

# orocos_component(<target> <source>... [INSTALL <folder>] [VERSION <version>] [EXPORT <name>])
# Builds a library of components; the rtcf package is the CMake project. INSTALL, VERSION and EXPORT
# are ignored. The include path contains the headers and generated code of all packages that catkin
# found, as OROCOS provided by package.xml.
function(orocos_component target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "INSTALL;VERSION;EXPORT" "")
  rtcf_add_components(${target} PACKAGE ${PROJECT_NAME} SOURCES ${arg_UNPARSED_ARGUMENTS}
                      LINK rtcf::rtt_compat)
  _rtcf_oro_dress(${target})
endfunction()

# orocos_library(<target> <source>... [INSTALL <folder>] [VERSION <version>] [EXPORT <name>])
# Builds a library that several components share.
function(orocos_library target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "INSTALL;VERSION;EXPORT" "")
  add_library(${target} SHARED ${arg_UNPARSED_ARGUMENTS})
  set_property(TARGET ${target} APPEND PROPERTY LINK_LIBRARIES rtcf::rtt_compat)
  _rtcf_oro_dress(${target})
  install(TARGETS ${target} LIBRARY DESTINATION lib)
endfunction()

function(_rtcf_oro_dress target)
  target_include_directories(${target} PRIVATE ${catkin_INCLUDE_DIRS})
  if(catkin_EXPORTED_TARGETS)
    add_dependencies(${target} ${catkin_EXPORTED_TARGETS})
  endif()
  if(${PROJECT_NAME}_EXPORTED_TARGETS)
    add_dependencies(${target} ${${PROJECT_NAME}_EXPORTED_TARGETS})
  endif()
endfunction()

# orocos_typekit(…), orocos_typegen_headers(…): ports carry any type, so there is nothing to build.
function(orocos_typekit target)
  message(STATUS "rtcf needs no typekit: orocos_typekit(${target}) does nothing")
endfunction()
function(orocos_typegen_headers)
  message(STATUS "rtcf needs no typekits: orocos_typegen_headers() does nothing")
endfunction()

# Plugins, services and programs of OROCOS fail when CMake runs, not when a component is missing at
# run time.
function(_rtcf_oro_no_plugins call)
  message(FATAL_ERROR "${call}: rtcf does not support plugins and services of OROCOS; "
                      "build shared code of components with orocos_library()")
endfunction()
function(orocos_plugin target)
  _rtcf_oro_no_plugins("orocos_plugin(${target})")
endfunction()
function(orocos_service target)
  _rtcf_oro_no_plugins("orocos_service(${target})")
endfunction()
function(orocos_executable target)
  message(FATAL_ERROR "orocos_executable(${target}): rtcf does not run programs of OROCOS; "
                      "build components with orocos_component()")
endfunction()

# orocos_install_headers([<file>...] [FILES <file>...] [DIRECTORY <folder>...] [INSTALL <folder>])
function(orocos_install_headers)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "INSTALL" "FILES;DIRECTORY")
  if(NOT arg_INSTALL)
    set(arg_INSTALL include/orocos/${PROJECT_NAME})
  endif()
  install(FILES ${arg_UNPARSED_ARGUMENTS} ${arg_FILES} DESTINATION ${arg_INSTALL})
  if(arg_DIRECTORY)
    install(DIRECTORY ${arg_DIRECTORY} DESTINATION ${arg_INSTALL})
  endif()
endfunction()

# orocos_use_package(<name> …), orocos_find_package(<name> …): these packages are either part of
# rtcf (ocl-logging, rtt_rosclock …) or catkin packages, for find_package(catkin).
macro(orocos_use_package)
endmacro()
macro(orocos_find_package)
endmacro()
macro(orocos_uninstall_target)
endmacro()

# orocos_generate_package([INCLUDE_DIRS <folder>...] [DEPENDS …] [DEPENDS_TARGETS …])
# Makes the project a catkin package, unless it calls catkin_package() itself, before or after.
macro(orocos_generate_package)
  if(COMMAND catkin_package)
    cmake_parse_arguments(_rtcf_oro "" "VERSION" "INCLUDE_DIRS;DEPENDS;DEPENDS_TARGETS" ${ARGN})
    set_property(DIRECTORY PROPERTY rtcf_oro_include_dirs "${_rtcf_oro_INCLUDE_DIRS}")
    if(NOT ${PROJECT_NAME}_CATKIN_PACKAGE)
      cmake_language(DEFER CALL _rtcf_oro_catkin_package)
    endif()
  endif()
endmacro()

macro(_rtcf_oro_catkin_package)
  if(NOT ${PROJECT_NAME}_CATKIN_PACKAGE)
    get_property(_rtcf_oro_dirs DIRECTORY PROPERTY rtcf_oro_include_dirs)
    get_property(_rtcf_oro_typekits DIRECTORY PROPERTY rtcf_oro_typekits)
    # Packages that depend on this one need the messages of its typekits.
    set(_rtcf_oro_extras)
    if(_rtcf_oro_typekits)
      set(_rtcf_oro_extra ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}-messages.cmake)
      file(
        CONFIGURE
        OUTPUT ${_rtcf_oro_extra}
        CONTENT
          "# The messages that ${PROJECT_NAME} was to make known to OROCOS.
foreach(_rtcf_oro_messages ${_rtcf_oro_typekits})
  find_package(\${_rtcf_oro_messages} REQUIRED NO_MODULE)
  list(APPEND ${PROJECT_NAME}_INCLUDE_DIRS \${\${_rtcf_oro_messages}_INCLUDE_DIRS})
  list(APPEND ${PROJECT_NAME}_LIBRARIES \${\${_rtcf_oro_messages}_LIBRARIES})
  list(APPEND ${PROJECT_NAME}_EXPORTED_TARGETS \${\${_rtcf_oro_messages}_EXPORTED_TARGETS})
endforeach()
"
        @ONLY)
      set(_rtcf_oro_extras CFG_EXTRAS ${_rtcf_oro_extra})
    endif()
    catkin_package(INCLUDE_DIRS ${_rtcf_oro_dirs} ${_rtcf_oro_extras})
  endif()
endmacro()
