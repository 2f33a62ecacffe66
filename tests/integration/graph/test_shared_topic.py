"""Two components that write one name: allowed, with a note, while no input reads it; ROS, too."""

import subprocess

import pytest
from daemon_process import Daemon, with_ros
from ros_processes import Master


@pytest.fixture
def settings(master: Master) -> str:
    """Return settings with a ROS node for the loops of `daemon`."""
    return with_ros(master.uri, "/shared")


def test_two_writers_can_share_a_topic_until_an_input_reads_it(
    daemon: Daemon, master: Master
) -> None:
    for name, amplitude in (("one", "1.0"), ("five", "5.0")):
        done = daemon.ctl(
            *("load", "rtcf_examples", "Wave", "--name", name, "--remap", "wave:=/shared"),
            *("--param", f"amplitude:={amplitude}", "--param", "shape:=square"),
        )
        assert done.returncode == 0, done.stderr
    assert "topic /shared has 2 writers in this runner: /one.wave, /five.wave" in done.stderr
    assert "/one.wave, /five.wave" in daemon.ctl("connections").stdout
    assert daemon.ctl("start").returncode == 0
    echo = subprocess.run(
        ["/usr/bin/rostopic", "echo", "-n", "200", "/shared/data"],
        env=master.environment(),
        capture_output=True,
        text=True,
        timeout=60.0,
        check=True,
    )
    values = {abs(float(line)) for line in echo.stdout.split() if line != "---"}
    assert values == {1.0, 5.0}
    reader = daemon.ctl("load", "rtcf_examples", "Identity", "--remap", "in:=/shared")
    assert reader.returncode == 1
    assert "/shared has two writers and a reader" in reader.stderr
    assert daemon.ctl("stop").returncode == 0
