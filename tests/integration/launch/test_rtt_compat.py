"""Components written for RTCF 2021, with the ROS interface that they expect."""

import json
import re
import subprocess
from pathlib import Path

import pytest
import rosgraph
import rtcf
from daemon_process import BUILD_TREE, Daemon, clean_environment, wait_for, with_ros
from pages import TREE
from ros_processes import Master
from values import iteration

LISTING = TREE / "tests" / "components" / "compat" / "listing.cpp"
TUNED = Path(__file__).with_name("tuned")
BUILD_S = 600.0


@pytest.fixture
def settings(master: Master) -> str:
    """Return settings with a ROS node for the loops of `daemon`."""
    return with_ros(master.uri, "/ros/.*")


def test_listing_1_of_the_paper_runs(daemon: Daemon, master: Master) -> None:
    """Two of them as in Listing 2: values written to /ros/in appear on /ros/out."""
    _set_parameter(master, "/test_param", "4.25")
    with rtcf.Client(daemon.socket) as client:
        load = ("load", "rtcf_compat", "PaperExample", "--name")
        first = daemon.ctl(
            *load, "example1", "--first", "--remap", "in_port:=/ros/in", "--remap", "out_port:=/tmp"
        )
        second = daemon.ctl(
            *load, "example2", "--remap", "in_port:=/tmp", "--remap", "out_port:=/ros/out"
        )
        assert (first.returncode, first.stderr) == (0, "")
        assert (second.returncode, second.stderr) == (0, "")
        assert daemon.ctl("order").stdout.split() == ["/example1", "/example2"]
        client.start()
        writer = subprocess.Popen(
            ["/usr/bin/rostopic", "pub", "/ros/in", "std_msgs/Float32", "0.1"],
            env=master.environment(),
        )
        try:
            wait_for(lambda: _value(daemon, "example2", "out_port") == 0.1, "the value")
        finally:
            writer.terminate()
            writer.wait()
        client.stop()
    for said in ("Fetched param with value 4.25", "Update hook called!"):
        wait_for(lambda: said in daemon.log(), said)  # noqa: B023


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the package `tuned` as its author would; return the folder of its components."""
    folder = tmp_path_factory.mktemp("tuned")
    steps = (
        [
            *("cmake", "-S", str(TUNED), "-B", str(folder), "-G", "Ninja"),
            *(
                f"-Drtcf_DIR={BUILD_TREE / 'cmake' / 'rtcf'}",
                "-DPYTHON_EXECUTABLE=/usr/bin/python3",
            ),
            *("-DCATKIN_BUILD_BINARY_PACKAGE=ON", "-DCATKIN_ENABLE_TESTING=OFF"),
            # Debug information and speed do not matter here.
            "-DCMAKE_CXX_FLAGS=-O0",
        ],
        ["cmake", "--build", str(folder)],
    )
    for step in steps:
        done = subprocess.run(
            step,
            env=clean_environment() | {"ROS_LANG_DISABLE": "genlisp"},
            capture_output=True,
            text=True,
            timeout=BUILD_S,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "devel" / "lib" / "rtcf-components"


def test_cfg_file_tunes_a_running_loop(tmp_path: Path, master: Master, tuned: Path) -> None:
    # A value on the parameter server applies from the start.
    _set_parameter(master, "/arm/tuned/steps", "4")
    daemon = Daemon(tmp_path, f"[daemon]\npath = ['{tuned}']\n" + with_ros(master.uri, ""))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.load(rtcf.component("tuned", "Tuned", name="tuned", ns="/arm"))
            client.start()
            wait_for(lambda: _value(daemon, "/arm/tuned", "value") == -1.0, "the default")
            # Four types in one change.
            _dynparam(master, "set", "/arm/tuned", "{enabled: true, gain: 0.5, label: 'two words'}")
            wait_for(lambda: _value(daemon, "/arm/tuned", "value") == 2.0, "the new values")
            # Out of bounds: the server clamps.
            _dynparam(master, "set", "/arm/tuned", "gain", "1000")
            wait_for(lambda: _value(daemon, "/arm/tuned", "value") == 40.0, "the largest value")
            assert _value(daemon, "/arm/tuned", "changes") == 3.0
            told = _dynparam(master, "get", "/arm/tuned")
            assert re.search(r"'gain': 10\.0", told)
            assert re.search(r"'label': 'two words'", told)
            wait_for(lambda: iteration(client) > 0, "the loop")
            client.stop()
    finally:
        daemon.end()


def _set_parameter(master: Master, name: str, value: str) -> None:
    rosgraph.Master("/test", master.uri).setParam(name, json.loads(value))


def _dynparam(master: Master, *arguments: str) -> str:
    """Run dynparam as rosrun does."""
    done = subprocess.run(
        # With Debian's Python, not the first one on PATH.
        ["/usr/bin/python3", "/usr/lib/dynamic_reconfigure/dynparam", *arguments],
        env=master.environment(),
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def _value(daemon: Daemon, component: str, port: str) -> float | None:
    done = daemon.ctl("info", component, "-o", "json")
    assert done.returncode == 0, done.stderr
    (found,) = (each for each in json.loads(done.stdout)["ports"] if each["name"] == port)
    return None if found["value"] is None else round(float(found["value"]["data"]), 6)
