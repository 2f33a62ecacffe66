"""rostest: several launch files with tests at once, each with its own master."""

from pathlib import Path

from daemon_process import DEADLINE_S, clean_environment, wait_for
from launch_processes import Process, build_tree_environment, left_over

# Node and topic names are the same in all; `wave` is published only by a running loop.
TEST = """
<launch>
  <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
    <param name="num_components_expected" value="1"/>
    <param name="ros_mapping_whitelist" value="/.*"/>
  </node>
  <node name="generator" pkg="rtcf" type="rt_launcher" args="rtcf_examples Wave">
    <remap from="wave" to="wave{index}"/>
  </node>
  <test test-name="wave{index}" pkg="rostest" type="publishtest" time-limit="{limit}">
    <rosparam>
      topics:
        - {{name: /wave{index}, timeout: {timeout}, negative: False}}
        - {{name: /wave{other}, timeout: 1, negative: True}}
    </rosparam>
  </test>
</launch>
"""


def test_rostests_at_random_ports_run_side_by_side(tmp_path: Path) -> None:
    tests = []
    for index in range(3):
        folder = tmp_path / str(index)
        folder.mkdir()
        file = folder / "wave.test"
        other = (index + 1) % 3
        text = TEST.format(index=index, other=other, timeout=DEADLINE_S, limit=2 * DEADLINE_S)
        file.write_text(text)
        environment = build_tree_environment(
            clean_environment() | {"ROS_HOME": str(folder), "ROS_HOSTNAME": "localhost"}
        )
        # publishtest uses the first python3 on PATH, which must be Debian's.
        environment["PATH"] = f"/usr/bin:{environment['PATH']}"
        command = ["/usr/bin/rostest", "--package=rtcf_examples", f"--pkgdir={folder}", str(file)]
        tests.append(Process(command, environment, folder))
    try:
        for test in tests:
            assert test.wait(5 * DEADLINE_S) == 0, test.output()
            assert "RESULT: SUCCESS" in test.output()
            assert "TESTS: 1\n" in test.output()
    finally:
        for test in tests:
            test.make_sure()
    # Each has ended its private daemon.
    sockets = [each.output().partition("private daemon at ")[2].partition(",")[0] for each in tests]
    assert len(set(sockets)) == 3
    for socket in sockets:
        wait_for(lambda: not left_over(socket), "the private daemon to end")  # noqa: B023
