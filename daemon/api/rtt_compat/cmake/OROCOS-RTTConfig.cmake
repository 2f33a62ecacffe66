# find_package(OROCOS-RTT) for packages written for RTCF 2021: sets OROCOS' variables to rtcf's
# headers of the same names. UseOROCOS-RTT.cmake has the macros.

# Rejects a package of the workspace that hides rtcf.
include(${CMAKE_CURRENT_LIST_DIR}/../rtcf/rtcf-workspace.cmake)
find_package(rtcf REQUIRED CONFIG)
get_filename_component(OROCOS-RTT_USE_FILE_PATH ${CMAKE_CURRENT_LIST_DIR} ABSOLUTE)
set(OROCOS-RTT_USE_FILE ${OROCOS-RTT_USE_FILE_PATH}/UseOROCOS-RTT.cmake)
set(OROCOS-RTT_FOUND TRUE)
set(OROCOS_TARGET gnulinux)

set(OROCOS-RTT_INCLUDE_DIRS ${rtcf_INCLUDE_DIRS})
set(OROCOS-RTT_LIBRARIES ${rtcf_LIBRARIES})
set(OROCOS-RTT_VERSION 2.9.0)
# rtcf has nothing for OROCOS' components (rtt-marshalling, rtt-scripting …).
foreach(_oro_component IN LISTS OROCOS-RTT_FIND_COMPONENTS)
  set(OROCOS-RTT_${_oro_component}_FOUND TRUE)
  string(TOUPPER "${_oro_component}" _oro_upper)
  set(OROCOS-RTT_${_oro_upper}_FOUND TRUE)
endforeach()
