"""roslaunch with the installed packages: no folder is sourced, no daemon runs."""

import os
import signal
import socket
import subprocess
import time
from pathlib import Path

import pytest
from installed import run

DEADLINE_S = 120.0


def test_the_papers_evaluation_runs_from_the_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        port = probe.getsockname()[1]
    for name in ("ROS_PACKAGE_PATH", "CMAKE_PREFIX_PATH", "PYTHONPATH", "RTCF_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ROS_MASTER_URI", f"http://localhost:{port}")
    monkeypatch.setenv("ROS_HOSTNAME", "localhost")
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros"))
    output = tmp_path / "output"
    with output.open("wb") as stream:
        launch = subprocess.Popen(
            ["/usr/bin/roslaunch", "-p", str(port), "rtcf_examples", "paper_evaluation.launch"],
            stdout=stream,
            stderr=stream,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
            start_new_session=True,
        )
    try:
        deadline = time.monotonic() + DEADLINE_S
        while "the loop runs with 5 components" not in output.read_text():
            assert launch.poll() is None and time.monotonic() < deadline, output.read_text()
            time.sleep(0.05)
        order = run("/usr/lib/rtcf/component_order").stdout
        assert order.split() == ["/H1", "/F1", "/R1", "/R2", "/R3"]
    finally:
        launch.send_signal(signal.SIGINT)
        launch.wait(DEADLINE_S)
    assert "escalating" not in output.read_text()


@pytest.mark.parametrize("program", ["rt_runner", "rt_launcher", "component_list"])
def test_each_node_and_tool_explains_itself(program: str) -> None:
    assert "usage: rosrun rtcf " in run(f"/usr/lib/rtcf/{program}", "--help").stdout
