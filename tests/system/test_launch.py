"""roslaunch with the installed packages, by a user without access to the system's daemon."""

import shlex
import signal

import pages
import pytest
from machine import Machine, wait_for

PORT = 11400
# The environment of that user's shell.
ROS = f"export ROS_MASTER_URI=http://localhost:{PORT} ROS_HOSTNAME=localhost; "


@pytest.mark.parametrize("user", ["root", "mallory"])
def test_the_papers_evaluation_runs_from_the_packages(machine: Machine, user: str) -> None:
    log = f"/var/tmp/launch-{user}"
    # The default gives nodes 15 s to end, which a busy machine may exceed.
    roslaunch = f"roslaunch -p {PORT} --sigint-timeout=60 rtcf_examples paper_evaluation.launch"
    home = f"export HOME=~{user}; cd ~{user}"
    script = f"{ROS} {home}; export PYTHONUNBUFFERED=1; exec {roslaunch} >{log} 2>&1"
    launch = machine.start("bash", "-c", script, user=user)
    output = machine.path(log)
    try:

        def running() -> bool:
            assert launch.poll() is None, output.read_text()
            return output.exists() and "the loop runs with 5 components" in output.read_text()

        wait_for(running, "the loop of the launch file")
        done = machine.shell(f"{ROS} /usr/lib/rtcf/component_order --table", user=user)
        assert done.stdout.split() == ["/H1", "/F1", "/R1", "/R2", "/R3"]
    finally:
        machine.shell(f"pkill -INT -u {user} -o -f '[r]oslaunch -p {PORT}'", check=False)
        launch.wait(120.0)
    assert launch.returncode in (0, -signal.SIGINT)
    assert "escalating" not in output.read_text()


def test_the_launch_files_of_the_docs_are_in_the_packages(machine: Machine) -> None:
    text = (pages.TREE / "docs" / "launching.md").read_text()
    lines = (shlex.split(line, comments=True) for line in pages.shell_lines(text))
    named = [words[1:] for words in lines if words[0] == "roslaunch"]
    assert ["rtcf_examples", "paper_evaluation.launch"] in named
    for words in named:
        roslaunch = f"{ROS} export HOME=/root; roslaunch --files {shlex.join(words)}"
        (file,) = machine.shell(roslaunch).stdout.split()
        (package,) = machine.shell(f"dpkg-query --search {file} | cut -d: -f1").stdout.split()
        assert package == "rtcf-components", "the package named in the docs"


@pytest.mark.parametrize("program", ["rt_runner", "rt_launcher", "component_list"])
def test_each_node_and_tool_explains_itself(machine: Machine, program: str) -> None:
    assert "usage: rosrun rtcf " in machine.run(f"/usr/lib/rtcf/{program}", "--help").stdout
