# rtt_roscomm's functions for typekit packages of messages (`rtt_my_msgs` for `my_msgs`). rtcf's
# ports carry any message, so such a package only depends on the messages.
include(${CMAKE_CURRENT_LIST_DIR}/../OROCOS-RTT/UseOROCOS-RTT.cmake)

function(ros_generate_rtt_typekit package)
  set_property(DIRECTORY APPEND PROPERTY rtcf_oro_typekits ${package})
endfunction()
function(ros_generate_rtt_service_proxies package)
  # Node handles call services.
endfunction()
function(rtt_roscomm_debug)
endfunction()
macro(rtt_roscomm_generate_package package)
  ros_generate_rtt_typekit(${package})
  orocos_generate_package()
endmacro()
