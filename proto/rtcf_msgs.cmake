# The ROS messages: C++ headers in the target rtcf_msgs, and the Python module
# rtcf_msgs in the build tree. The package is a separate project, because catkin
# changes the output folders of its project.
set(package ${CMAKE_CURRENT_SOURCE_DIR}/rtcf_msgs)
set(build ${CMAKE_CURRENT_BINARY_DIR}/rtcf_msgs)
set(stage ${CMAKE_CURRENT_BINARY_DIR}/rtcf_msgs-stage)
set(staged ${stage}${CMAKE_INSTALL_PREFIX})
# A path without the prefix: the compiler cache serves builds for any.
set(include ${CMAKE_CURRENT_BINARY_DIR}/rtcf_msgs-include)
set(python_modules lib/python3/dist-packages)

file(GLOB definitions CONFIGURE_DEPENDS ${package}/msg/*.msg ${package}/srv/*.srv)
set(headers)
foreach(definition IN LISTS definitions)
  cmake_path(GET definition STEM name)
  list(APPEND headers ${include}/rtcf_msgs/${name}.h)
endforeach()

set(stamp ${CMAKE_CURRENT_BINARY_DIR}/rtcf_msgs.stamp)
add_custom_command(
  OUTPUT ${stamp}
  BYPRODUCTS ${headers}
  # No code for Lisp.
  COMMAND
    ${CMAKE_COMMAND} -E env ROS_LANG_DISABLE=genlisp ${CMAKE_COMMAND} -S ${package} -B ${build} -G
    ${CMAKE_GENERATOR} --log-level=WARNING -DCMAKE_INSTALL_PREFIX=${CMAKE_INSTALL_PREFIX}
    -DCMAKE_INSTALL_MESSAGE=NEVER -DPYTHON_EXECUTABLE=${PYTHON_EXECUTABLE}
    -DCATKIN_BUILD_BINARY_PACKAGE=ON -DCATKIN_ENABLE_TESTING=OFF
  COMMAND ${CMAKE_COMMAND} --build ${build}
  COMMAND ${CMAKE_COMMAND} -E env DESTDIR=${stage} ${CMAKE_COMMAND} --install ${build}
  COMMAND ${CMAKE_COMMAND} -E create_symlink ${staged}/${python_modules}/rtcf_msgs
          ${PROJECT_BINARY_DIR}/python/rtcf_msgs
  COMMAND ${CMAKE_COMMAND} -E touch ${stamp}
  DEPENDS ${definitions} ${package}/package.xml ${package}/CMakeLists.txt
  COMMENT "Building the ROS package rtcf_msgs"
  VERBATIM)
add_custom_target(rtcf_msgs_build ALL DEPENDS ${stamp})

file(MAKE_DIRECTORY ${staged}/include)
file(CREATE_LINK ${staged}/include ${include} SYMBOLIC)
add_library(rtcf_msgs INTERFACE)
target_include_directories(rtcf_msgs SYSTEM INTERFACE ${include})
add_dependencies(rtcf_msgs rtcf_msgs_build)

install(DIRECTORY ${staged}/include/rtcf_msgs DESTINATION include COMPONENT ros-rtcf)
install(DIRECTORY ${staged}/share/rtcf_msgs DESTINATION share COMPONENT ros-rtcf)
# Installed separately, because catkin's folder for it depends on the prefix.
install(FILES ${build}/catkin_generated/installspace/rtcf_msgs.pc DESTINATION share/pkgconfig
        COMPONENT ros-rtcf)
install(
  DIRECTORY ${staged}/${python_modules}/rtcf_msgs
  DESTINATION ${python_modules}
  COMPONENT ros-rtcf
  PATTERN __pycache__ EXCLUDE)
