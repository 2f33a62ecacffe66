"""Templates of the files that `rtcfctl new` creates."""

from string import Template

_PACKAGE = """\
<?xml version="1.0"?>
<package format="2">
  <name>$package</name>
  <version>0.1.0</version>
  <description>Components of $package for rtcf</description>
  <maintainer email="me@example.org">me</maintainer>
  <license>TODO</license>
  <buildtool_depend>catkin</buildtool_depend>
</package>
"""

_GRAPH = """\
# Apply it to a runner with `rtcfctl apply graph.yaml`; see rtcf-graph(5).
components:
  - name: $name
    package: $package
    type: $component
    parameters:
      gain: 2.0
"""

_CMAKE_HEAD = """\
cmake_minimum_required(VERSION 3.25)
project($package LANGUAGES CXX)
find_package(rtcf REQUIRED)
if(DEFINED CATKIN_DEVEL_PREFIX)  # by catkin_make; else plain CMake
  find_package(catkin REQUIRED)
  catkin_package()
endif()
"""

_CMAKE_CPP = (
    _CMAKE_HEAD
    + """
rtcf_add_components($package PACKAGE $package SOURCES src/$name.cpp)

include(CTest)
if(BUILD_TESTING)
  find_package(GTest REQUIRED)  # libgtest-dev
  add_executable(${name}_test test/${name}_test.cpp src/$name.cpp)
  target_link_libraries(${name}_test rtcf::rtcf GTest::gtest_main)
  add_test(NAME $name COMMAND ${name}_test)
endif()
"""
)

_CPP = """\
#include <rtcf/component.hpp>

#include <algorithm>

class $component : public rtcf::Component {
    rtcf::Input<double> setpoint{this, "setpoint"};
    rtcf::Input<double> measured{this, "measured"};
    rtcf::Output<double> effort{this, "effort"};
    rtcf::Parameter<double> gain{this, "gain", 1.0, rtcf::Min(0.0), rtcf::Doc("effort per error")};
    rtcf::Parameter<double> limit{this, "limit", 10.0, rtcf::Min(0.0),
                                  rtcf::Doc("largest effort, either way")};

    void update() override {
        const bool has_setpoint = setpoint.read() != rtcf::DataStatus::None;
        if (measured.read() == rtcf::DataStatus::None || !has_setpoint) return;
        const double error = setpoint.value() - measured.value();
        effort.write(std::clamp(gain * error, -limit.value(), limit.value()));
    }

    void safe() noexcept override { effort.write(0.0); }
};

RTCF_COMPONENT($component, "Proportional control with limited effort")
"""

_CPP_TEST = """\
#include <gtest/gtest.h>

#include <rtcf/test.hpp>

TEST($component, FollowsTheError) {
    rtcf::test::Bench bench("$component", {{"gain", 3.0}});
    bench.write("setpoint", 1.0);
    bench.write("measured", 0.5);
    bench.cycle();
    EXPECT_EQ(*bench.read<double>("effort"), 1.5);
}

TEST($component, StaysWithinItsLimitAndEndsSafe) {
    rtcf::test::Bench bench("$component", {{"gain", 100.0}, {"limit", 2.0}});
    bench.write("setpoint", 1.0);
    bench.write("measured", 0.0);
    bench.cycle();
    EXPECT_EQ(*bench.read<double>("effort"), 2.0);
    bench.safe();
    EXPECT_EQ(*bench.read<double>("effort"), 0.0);
}
"""

_CMAKE_PYTHON = (
    _CMAKE_HEAD
    + """
rtcf_add_python_components($package PACKAGE $package SOURCES src/$name.py)

include(CTest)
if(BUILD_TESTING)
  rtcf_add_python_test($name)  # python3-pytest
endif()
"""
)

_PYTHON = '''\
from rtcf.component import Component, Input, Output, Parameter


class $component(Component):
    """Proportional control with limited effort."""

    setpoint: Input[float]
    measured: Input[float]
    effort: Output[float]
    gain: Parameter[float] = Parameter(1.0, min=0.0, doc="effort per error")
    limit: Parameter[float] = Parameter(10.0, min=0.0, doc="largest effort, either way")

    def update(self):
        if not (self.setpoint.valid and self.measured.valid):
            return
        error = self.setpoint.value - self.measured.value
        self.effort.write(min(max(self.gain * error, -self.limit), self.limit))

    def safe(self):
        self.effort.write(0.0)
'''

_PYTHON_TEST = """\
from $name import $component


def test_it_follows_the_error():
    tried = $component(gain=3.0)
    tried.setpoint.put(1.0)
    tried.measured.put(0.5)
    tried.cycle()
    assert tried.effort.value == 1.5


def test_it_stays_within_its_limit_and_ends_safe():
    tried = $component(gain=100.0, limit=2.0)
    tried.setpoint.put(1.0)
    tried.measured.put(0.0)
    tried.cycle()
    assert tried.effort.value == 2.0
    tried.safe()
    assert tried.effort.value == 0.0
"""

_PYTEST = """\
[pytest]
pythonpath = src
cache_dir = build/pytest
"""

_OF_BOTH = {"package.xml": _PACKAGE, "graph.yaml": _GRAPH}
_CPP_FILES = {
    "CMakeLists.txt": _CMAKE_CPP,
    "src/$name.cpp": _CPP,
    "test/${name}_test.cpp": _CPP_TEST,
}
_PYTHON_FILES = {
    "CMakeLists.txt": _CMAKE_PYTHON,
    "pytest.ini": _PYTEST,
    "src/$name.py": _PYTHON,
    "test/test_$name.py": _PYTHON_TEST,
}
# Class names that the templates import or include.
TAKEN = ("Component", "Input", "Output", "Parameter")


def files(package: str, component: str, name: str, python: bool) -> dict[str, str]:
    """Return the text of each file; `name` names the source file and the component in the graph."""
    words = {"package": package, "component": component, "name": name}
    return {
        Template(path).substitute(words): Template(text).substitute(words)
        for path, text in {**_OF_BOTH, **(_PYTHON_FILES if python else _CPP_FILES)}.items()
    }
