# Rejects a package of a workspace that hides one of ours, e.g. a checkout of RTCF 2021 left in
# src/: ROS would build and run it instead of the installed package.
foreach(_rtcf_package rtcf rtcf_msgs)
  set(_rtcf_theirs "")
  if(PROJECT_NAME STREQUAL _rtcf_package AND COMMAND catkin_package)
    set(_rtcf_theirs ${CMAKE_CURRENT_SOURCE_DIR})
  endif()
  # catkin_make lists its packages in these variables.
  list(FIND CATKIN_ORDERED_PACKAGES ${_rtcf_package} _rtcf_at)
  if(NOT _rtcf_at EQUAL -1)
    list(GET CATKIN_ORDERED_PACKAGE_PATHS ${_rtcf_at} _rtcf_theirs)
    cmake_path(ABSOLUTE_PATH _rtcf_theirs BASE_DIRECTORY ${CMAKE_SOURCE_DIR})
  endif()
  if(_rtcf_theirs)
    message(
      FATAL_ERROR
        "The package ${_rtcf_package} of this workspace (${_rtcf_theirs}) hides the installed one of "
        "that name. Is it RTCF 2021's? Remove it from the workspace, with rtcf_examples and "
        "rtt_rtcf_msgs if they are there, or put a file CATKIN_IGNORE beside its package.xml; then "
        "build anew: rm -r build devel && catkin_make. Give another package of yours another name.")
  endif()
endforeach()
