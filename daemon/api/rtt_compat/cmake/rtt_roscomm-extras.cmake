# rtt_roscomm's functions for typekit packages of messages, `rtt_my_msgs` beside `my_msgs`: rtcf's
# ports carry messages as they are, so such a package only leads to the messages.
include(${CMAKE_CURRENT_LIST_DIR}/../OROCOS-RTT/UseOROCOS-RTT.cmake)

function(ros_generate_rtt_typekit package)
  set_property(DIRECTORY APPEND PROPERTY rtcf_oro_typekits ${package})
endfunction()
function(ros_generate_rtt_service_proxies package)
  # Services are called by node handles.
endfunction()
function(rtt_roscomm_debug)
endfunction()
macro(rtt_roscomm_generate_package package)
  ros_generate_rtt_typekit(${package})
  orocos_generate_package()
endmacro()
