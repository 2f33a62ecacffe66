"""A catkin workspace of an RTCF 2021 user: messages, their typekit package, components with
OROCOS' CMake; built by catkin_make, run from devel/ and from install/."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE, clean_environment, wait_for
from launch_processes import Launching, Process, build_tree_environment
from ros_processes import Master

SOURCES = Path(__file__).with_name("old_workspace")
BUILD_S = 900.0
TEST_S = 300.0
DONE = 0


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build it as its author would, on top of this build tree."""
    folder = tmp_path_factory.mktemp("workspace")
    shutil.copytree(SOURCES, folder / "src")
    done = subprocess.run(
        [
            *(
                "/usr/bin/catkin_make",
                "-C",
                str(folder),
                "install",
                "-DPYTHON_EXECUTABLE=/usr/bin/python3",
            ),
            # Debug information and speed do not matter here.
            *("-DCMAKE_CXX_FLAGS=-O0", "-DCATKIN_ENABLE_TESTING=OFF"),
        ],
        cwd=folder,
        env=build_tree_environment(clean_environment())
        | {"ROS_LANG_DISABLE": "genlisp:geneus:gennodejs"},
        capture_output=True,
        text=True,
        timeout=BUILD_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def environment(workspace: Path, space: str, base: dict[str, str]) -> dict[str, str]:
    """Return the environment after sourcing a space's setup.sh on top of the build tree's."""
    done = subprocess.run(
        ["/bin/sh", "-c", ". ./setup.sh && env -0"],
        cwd=workspace / space,
        env=build_tree_environment(base),
        stdout=subprocess.PIPE,
        check=True,
    )
    lines = (line.partition("=") for line in done.stdout.decode().split("\0") if line)
    return {name: value for name, _, value in lines}


@pytest.fixture(params=["devel", "install"])
def launching(
    request: pytest.FixtureRequest, workspace: Path, tmp_path: Path, master: Master
) -> Iterator[Launching]:
    """Yield a starter of nodes in one of its spaces."""
    launching = Launching(master, tmp_path)
    launching.environment = environment(workspace, request.param, master.environment()) | {
        "RTCF_SOCKET": "/nonexistent",
        "PYTHONUNBUFFERED": "1",
        "PATH": launching.environment["PATH"],
    }
    yield launching
    launching.end()


def test_its_launch_file_and_rosrun_work_from_both_spaces(
    launching: Launching, master: Master, workspace: Path
) -> None:
    launch = launching.roslaunch("old_components", "old.launch")
    launch.wait_for_output("the loop runs with 1 components")
    with launching.client() as (client, runner):
        component = client.get_component("/scaler", runner)
        space = (
            "devel"
            if f"{workspace}/devel" in launching.environment["CMAKE_PREFIX_PATH"]
            else ("install")
        )
        folder = workspace / space / "lib" / "rtcf-components" / "old_components"
        assert component.library == str(folder / "old_components.so")
        assert (component.spec.type, component.spec.package) == ("Scaler", "old_components")
        types = {port.name: port.type for port in component.ports}
        assert types == {"in": "std_msgs/Float64", "out": "old_msgs/Scaled"}
        source = subprocess.Popen(
            ["/usr/bin/rostopic", "pub", "/mapped/in", "std_msgs/Float64", "2.0"],
            env=master.environment(),
        )
        try:
            wait_for(lambda: "6" in _value(client, runner), "the scaled value")
        finally:
            source.terminate()
            source.wait()
    told = launching.tool("component_list")
    assert "/scaler" in told.stdout, told.stderr
    assert launch.end() == DONE
    # Each hook ran, including those that Ctrl-C triggers.
    for text in ("constructed", "scaling by 3", "stopped", "cleaned up"):
        assert f"/scaler: {text}\n" in launch.output()


def _value(client: object, runner: str) -> str:
    component = client.get_component("/scaler", runner)  # type: ignore[attr-defined]
    (value,) = (port.value for port in component.ports if port.name == "out")
    return str(value)


def test_its_rostest_passes(workspace: Path, tmp_path: Path) -> None:
    given = environment(workspace, "devel", clean_environment()) | {
        "ROS_HOME": str(tmp_path),
        "ROS_HOSTNAME": "localhost",
        "RTCF_SOCKET": "/nonexistent",
    }
    # publishtest uses the first python3 on PATH, which must be Debian's.
    given["PATH"] = f"/usr/bin:{given['PATH']}"
    test = Process(["/usr/bin/rostest", "old_components", "old.test"], given, tmp_path)
    try:
        assert test.wait(TEST_S) == DONE, test.output()
        assert "RESULT: SUCCESS" in test.output()
    finally:
        test.make_sure()


def test_the_workspace_hides_none_of_rtcfs_programs(workspace: Path) -> None:
    for space in ("devel", "install"):
        assert not (workspace / space / "lib" / "rtcf").exists()
    assert (BUILD_TREE / "devel" / "lib" / "rtcf" / "rt_runner").exists()


@pytest.mark.parametrize(
    ("line", "said", "instead"),
    [
        ("orocos_plugin(clock clock.cpp)", "orocos_plugin(clock): rtcf does not support plugins",
         "orocos_library()"),
        ("orocos_service(clock clock.cpp)", "orocos_service(clock): rtcf does not support plugins",
         "orocos_library()"),
        ("orocos_executable(deploy main.cpp)",
         "orocos_executable(deploy): rtcf does not run programs", "orocos_component()"),
        # A call that only has no effect here is no error.
        ("orocos_typekit(types types.hpp)", "orocos_typekit(types) does nothing", ""),
        ("orocos_typegen_headers(types.hpp)", "orocos_typegen_headers() does nothing", ""),
    ],
    ids=lambda text: str(text).partition("(")[0],
)  # fmt: skip
def test_unsupported_cmake_calls_are_reported(
    tmp_path: Path, line: str, said: str, instead: str
) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.0.2)\nproject(old LANGUAGES CXX)\n"
        "find_package(OROCOS-RTT REQUIRED)\n"
        f"include(${{OROCOS-RTT_USE_FILE_PATH}}/UseOROCOS-RTT.cmake)\n{line}\n"
    )
    done = subprocess.run(
        ["cmake", "-Wno-dev", "-Wno-deprecated", "-S", str(tmp_path), "-B", str(tmp_path / "b")],
        env=build_tree_environment(clean_environment()),
        capture_output=True,
        text=True,
        timeout=BUILD_S,
        check=False,
    )
    # CMake folds error messages.
    output = " ".join(f"{done.stdout} {done.stderr}".split())
    assert said in output
    assert (done.returncode != DONE) == bool(instead), output
    if instead:
        assert instead in output
        assert "CMakeLists.txt:5 (orocos_" in output, "the line is named"


def package(folder: Path, name: str, depends: str, lines: str) -> None:
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(
        f"<package format='2'><name>{name}</name><version>1.0.0</version>"
        "<description>none</description>"
        "<maintainer email='a@example.org'>a</maintainer><license>none</license>"
        f"<buildtool_depend>catkin</buildtool_depend>{depends}</package>"
    )
    (folder / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.0.2)\nproject({name})\n{lines}\n"
    )


@pytest.mark.parametrize(
    ("depends", "lines"),
    [
        # The start of RTCF 2021's own CMakeLists.txt.
        ("", "find_package(catkin REQUIRED COMPONENTS roscpp rtt_ros)"),
        # A package of that name without rtcf.
        ("<depend>std_msgs</depend>", "find_package(catkin REQUIRED)\ncatkin_package()"),
    ],
    ids=["rtcf's checkout", "another package"],
)
def test_a_package_that_hides_rtcf_is_reported_by_cmake(
    tmp_path: Path, depends: str, lines: str
) -> None:
    package(tmp_path / "src" / "left" / "rtcf", "rtcf", depends, lines)
    package(
        tmp_path / "src" / "mine", "mine", "<depend>rtcf</depend>",
        "find_package(OROCOS-RTT REQUIRED)",
    )  # fmt: skip
    done = subprocess.run(
        ["/usr/bin/catkin_make", "-C", str(tmp_path), "-DPYTHON_EXECUTABLE=/usr/bin/python3"],
        cwd=tmp_path,
        env=build_tree_environment(clean_environment()),
        capture_output=True,
        text=True,
        timeout=BUILD_S,
        check=False,
    )
    output = " ".join(f"{done.stdout} {done.stderr}".split())
    assert done.returncode != DONE
    assert f"The package rtcf of this workspace ({tmp_path}/src/left/rtcf) hides" in output
    assert "put a file CATKIN_IGNORE beside its package.xml" in output
