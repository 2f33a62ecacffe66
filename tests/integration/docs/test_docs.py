"""The commands of the pages in docs/, run verbatim in a build tree."""

import os
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import fig_1
import pytest
import rosbag
import rospy
import rtcf
from daemon_process import BUILD_TREE, NO_ROS, Daemon, clean_environment, wait_for
from documentation_commands import pages_typed, typed
from launch_processes import build_tree_environment
from pages import TREE, block
from std_msgs.msg import Float64

_COMPILE_DEADLINE_S = 900.0
_BAG_S = 1_700_000_000


def _nothing(_: Daemon, __: rtcf.Client) -> None:
    """Prepare nothing: the page needs an empty graph."""


def _wave_that_was_tuned(_: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave", parameters=["amplitude:=1.5"]))
    client.set_parameters("wave", [rtcf.parse_parameter("amplitude:=2.5")])


def _graph_of_a_file(name: str) -> Callable[[Daemon, rtcf.Client], None]:
    def prepare(daemon: Daemon, client: rtcf.Client) -> None:
        fig_1.load(client)
        assert daemon.ctl("save", str(daemon.folder / name)).returncode == 0
        client.unload(fig_1.ORDER)

    return prepare


def _loop_with_a_bag(daemon: Daemon, client: rtcf.Client) -> None:
    fig_1.load(client)
    assert daemon.ctl("runner", "set", "--whitelist", fig_1.WHITELIST).returncode == 0
    with rosbag.Bag(str(daemon.folder / "run.bag"), "w") as bag:
        bag.write("/G2_R2", Float64(0.5), rospy.Time(_BAG_S))
        bag.write("/G2_R2", Float64(1.5), rospy.Time(_BAG_S + 1))


def _pendulum(daemon: Daemon, _: rtcf.Client) -> None:
    (daemon.folder / "pendulum.xml").write_text(block("mujoco.md", "xml", "<mujoco>"))


# Setup that a page assumes.
PREPARE: dict[str, Callable[[Daemon, rtcf.Client], None]] = {
    "boot.md": _nothing,
    "control/index.md": _nothing,
    "control/biquads.md": _nothing,
    "control/excitation.md": _nothing,
    "control/friction.md": _nothing,
    "control/gravity.md": _nothing,
    "control/joints.md": _nothing,
    "control/kalman_filter.md": _nothing,
    "control/pid.md": _nothing,
    "control/safety.md": _nothing,
    "control/state_space.md": _nothing,
    "control/trajectory.md": _nothing,
    "first-ten-minutes.md": _nothing,
    "from-hal.md": _nothing,
    "from-ros-control.md": _nothing,
    "graph-files.md": _graph_of_a_file("arm.yaml"),
    "graph.md": _nothing,
    "incidents.md": _nothing,
    "mujoco.md": _pendulum,
    "operating.md": _nothing,
    "performance.md": _graph_of_a_file("fig1.yaml"),
    "ros.md": _nothing,
    "scope.md": _nothing,
    "security.md": _wave_that_was_tuned,
    "signals.md": _nothing,
    "simulation.md": _loop_with_a_bag,
    "troubleshooting.md": _nothing,
    "tuning.md": _nothing,
}
BY_THEMSELVES = {
    "README.md",  # test_readme.py
    "components.md",
    "control/motor.md",
    "python-components.md",
    "robot.md",
}


def test_the_commands_of_each_page_are_tested() -> None:
    assert {*PREPARE, *BY_THEMSELVES} == set(pages_typed())


@pytest.mark.parametrize("page", PREPARE)
def test_the_commands_of_a_page_succeed(page: str, daemon: Daemon, client: rtcf.Client) -> None:
    PREPARE[page](daemon, client)
    for line in typed(page):
        _type(line, daemon.folder, daemon.environment())


def test_the_tour_of_the_robot_succeeds(daemon: Daemon, client: rtcf.Client) -> None:
    file = BUILD_TREE / "devel" / "share" / "rtcf_arm" / "arm.yaml"
    assert daemon.ctl("apply", str(file)).returncode == 0
    (daemon.folder / "velocity_pi.py").write_text(block("robot.md", "python", "VelocityPi"))
    client.start()
    lines = list(typed("robot.md"))
    assert any("1e9" in line for line in lines)
    for line in lines:
        _type(line, daemon.folder, daemon.environment())
        if "1e9" in line:
            wait_for(client.list_incidents, "the incident of the fault")
    assert "/robot" in client.list_incidents()[-1].reason


def _type(line: str, folder: Path, environment: dict[str, str]) -> None:
    """Run a command line in a folder, which also replaces /tmp."""
    done = subprocess.run(
        ["bash", "-c", line.replace("/tmp/", f"{folder}/")],
        cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        timeout=_COMPILE_DEADLINE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"


@contextmanager
def _left_running(
    line: str, folder: Path, environment: dict[str, str], until: str
) -> Iterator[None]:
    """Run a command line until Ctrl-C; it has started once it prints `until`."""
    said = folder / f"said by {line.split()[0]}"
    with (
        said.open("wb") as to,
        subprocess.Popen(
            ["bash", "-c", "exec " + line.replace("/tmp/", f"{folder}/")],
            cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=to, stderr=to,
        ) as process,
    ):  # fmt: skip
        try:
            wait_for(
                lambda: until in said.read_text() or process.poll() is not None,
                line, _COMPILE_DEADLINE_S,
            )  # fmt: skip
            assert process.poll() is None, said.read_text()
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def _environment(folder: Path) -> dict[str, str]:
    return clean_environment() | {
        "PATH": f"{BUILD_TREE / 'bin'}:{os.environ['PATH']}",
        "RTCF_SOCKET": str(folder / "rtcf.sock"),
        "XDG_CACHE_HOME": str(folder / "cache"),
        # Replaces librtcf-dev.
        "rtcf_DIR": str(BUILD_TREE / "cmake" / "rtcf"),
    }


def test_the_component_of_the_docs_is_built_and_loaded(tmp_path: Path) -> None:
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "pi.cpp").write_text(block("components.md", "cpp", "class Pi "))
    (tmp_path / "CMakeLists.txt").write_text(block("components.md", "cmake", "project("))
    environment = _environment(tmp_path)
    build, daemon, load = typed("components.md")
    _type(build, tmp_path, environment)
    with _left_running(daemon, tmp_path, environment, "ready;"):
        _type(load, tmp_path, environment)
        with rtcf.Client(tmp_path / "rtcf.sock") as client:
            (kp,) = (p for p in client.get_component("arm_pi").parameters if p.name == "kp")
    assert kp.value.double_value == 4.0


def test_the_component_with_a_service_of_the_docs_is_built_and_described(tmp_path: Path) -> None:
    (tmp_path / "brake.cpp").write_text(block("components.md", "cpp", "class Brake "))
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\n"
        "project(brakes LANGUAGES CXX)\n"
        "find_package(rtcf REQUIRED)\n"
        "rtcf_add_components(brakes PACKAGE brakes SOURCES brake.cpp LINK rtcf::ros)\n"
    )
    _type("cmake -S . -B build && cmake --build build", tmp_path, _environment(tmp_path))
    daemon = Daemon(tmp_path, arguments=("--path", str(tmp_path / "build" / "lib" / "rtcf")))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            (found,) = client.list_types("brakes").types
    finally:
        daemon.end()
    assert [port.name for port in found.ports] == ["speed", "torque"]


def test_the_motor_of_the_docs_is_identified_tuned_and_tested(daemon: Daemon) -> None:
    page = "control/motor.md"
    (daemon.folder / "motor.yaml").write_text(block(page, "yaml", "rt_runner"))
    (daemon.folder / "test_motor.py").write_text(block(page, "python", "Bench"))
    environment = daemon.environment()
    environment |= {
        "PATH": f"{BUILD_TREE / 'bin'}:/usr/bin:{environment['PATH']}",
        "PYTHONPATH": str(BUILD_TREE / "python"),
    }
    for line in typed(page):
        _type(line, daemon.folder, environment)


def test_the_python_component_of_the_docs_is_compiled_and_loaded(tmp_path: Path) -> None:
    (tmp_path / "observer.py").write_text(block("python-components.md", "python", "class Obs"))
    environment = _environment(tmp_path)
    compile_, daemon, watch, verify = typed("python-components.md")
    _type(compile_, tmp_path, environment)
    with _left_running(daemon, tmp_path, environment, "ready;"):
        _type("rtcfctl --socket /tmp/rtcf.sock load motor Observer", tmp_path, environment)
        _type("rtcfctl unload Observer", tmp_path, environment)
        with _left_running(watch, tmp_path, environment, "loaded /Observer"):
            pass
    _type(verify, tmp_path, environment)


def test_the_workspace_of_the_docs_is_built_and_loaded_from_its_folder(
    tmp_path: Path,
) -> None:
    page = (TREE / "docs" / "ros-setup.md").read_text()
    package = tmp_path / "ws" / "src" / "my_package"
    environment = build_tree_environment(_environment(tmp_path)) | {"HOME": str(tmp_path)}
    begin, build = (block("ros-setup.md", "sh", each) for each in ("mkdir -p ~/ws", "catkin_make"))
    _type("\n".join(begin.splitlines()[1:]), tmp_path, environment)  # without apt's commands
    (package / "package.xml").write_text(block("ros-setup.md", "xml", "<name>my_package"))
    (package / "CMakeLists.txt").write_text(block("ros-setup.md", "cmake", "project(my_package"))
    (package / "gain.cpp").write_text(block("README.md", "cpp", "class Gain "))
    # Debug information and speed do not matter here; the last line starts the launch.
    environment["CXXFLAGS"] = "-O0"
    _type(f"set -e\n{build}env -0 > ~/given", tmp_path, environment)
    text = (tmp_path / "given").read_text()
    sourced = dict(line.split("=", 1) for line in text.split("\0") if "=" in line)
    assert f"{tmp_path}/ws/install" in sourced["CMAKE_PREFIX_PATH"].split(":")
    (said,) = re.findall(r"components are in `(\S+)`", page)
    assert [each.name for each in (tmp_path / "ws" / said).iterdir()] == ["my_package.so"]

    # With the folder in the settings, and with the workspace in the environment.
    (path,) = re.findall(r"`(path = \[.*\])`", page)
    named = tmp_path / "named"
    found = tmp_path / "found"
    daemons = [
        Daemon(named, f"[daemon]\n{path.replace('/home/alice', str(tmp_path))}\n{NO_ROS}"),
        Daemon(found, environment={"CMAKE_PREFIX_PATH": sourced["CMAKE_PREFIX_PATH"]}),
    ]
    for daemon in daemons:
        daemon.folder.mkdir()
        daemon.start()
        try:
            done = daemon.ctl("load", "my_package", "Gain", "--param", "gain:=2.5")
            assert (done.returncode, done.stdout) == (0, "loaded /Gain\n"), done.stderr
        finally:
            daemon.end()
