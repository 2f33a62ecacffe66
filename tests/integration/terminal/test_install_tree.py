"""The result of a default `make` can be installed with CMake alone."""

import subprocess
from pathlib import Path

from daemon_process import BUILD_TREE, DEADLINE_S


def test_the_ros_packages_are_installed_from_a_default_build(tmp_path: Path) -> None:
    done = subprocess.run(
        [
            *("cmake", "--install", str(BUILD_TREE), "--component", "ros-rtcf"),
            *("--prefix", str(tmp_path)),
        ],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for file in (
        "share/pkgconfig/rtcf_msgs.pc",
        "share/rtcf_msgs/package.xml",
        "include/rtcf_msgs/RunnerInfo.h",
        "lib/rtcf/rt_runner",
        "lib/rtcf/component_list",
        "lib/python3/dist-packages/rtcf_launch/runner_node.py",
    ):
        assert (tmp_path / file).is_file(), file
