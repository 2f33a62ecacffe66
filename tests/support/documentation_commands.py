"""The commands of the pages that run in a build tree, and the reasons why others do not."""

from pathlib import Path

from pages import TREE, shell_lines

PAGES = [
    TREE / "README.md",
    *sorted((TREE / "docs").glob("*.md")),
    *sorted((TREE / "docs").glob("control/*.md")),
]

_APT = "installs packages"
_BOOTED = "runs in a booted Debian: tests/system/test_pages.py"
_LAUNCH = "needs a master and a launch: tests/integration/launch/test_launch_files.py"
_BY_BLOCK = "runs with the lines around it: tests/integration/docs/test_docs.py"
_WORKSPACE = "builds a workspace: tests/integration/launch/test_old_workspace.py"

# By page: start of a line -> another test that runs it, or the reason why none does.
ELSEWHERE: dict[str, dict[str, str]] = {
    "README.md": {
        "make ": "builds this tree, which the test is part of",
        "sudo apt install ": _APT,
        "sudo adduser ": "changes the machine's accounts",
        "rtcfctl doctor": "depends on the machine: tests/unit/python/rtcfctl/test_doctor.py",
        "rostopic hz /there": "runs forever and needs a master: test_ros_topics.py",
        "sudo install ": _BOOTED,
        "cmake -S . -B build ": "installs into /usr, unlike that of components.md, which runs",
        "rtcfctl load my_package Gain": "needs a component installed into /usr",
    },
    "boot.md": {"sudo ": _BOOTED, "journalctl ": _BOOTED},
    "components.md": {"sudo cmake --install ": "installs into /usr"},
    "control/motor.md": {
        "rtcfctl scope": "runs until Ctrl-C: tests/integration/scope/test_scope.py"
    },
    "from-rtcf-2021.md": {
        "apt install ": _APT,
        "cd my_workspace": _WORKSPACE,
        ". devel": _WORKSPACE,
    },
    "graph.md": {"rtcfctl load my_package Pid": "needs a package of the reader"},
    "launching.md": {"roslaunch ": _LAUNCH, "rosrun ": _LAUNCH},
    "operating.md": {
        "rtcfctl doctor": "depends on the machine: tests/unit/python/rtcfctl/test_doctor.py",
        "sudo apt install ": _APT,
    },
    "performance.md": {"sudo perf ": "requires rights that a test may lack"},
    "python-components.md": {"sudo apt install ": _APT},
    "ros-setup.md": {
        "sudo apt install ": _APT,
        "roslaunch ": _LAUNCH,
        "mkdir ": _BY_BLOCK,
        "cd ~/ws": _BY_BLOCK,
        "catkin_make ": _BY_BLOCK,
        ". install/setup.sh": _BY_BLOCK,
    },
    "ros.md": {
        "rosservice ": "needs two machines and a master: tests/integration/ros/test_ros_names.py",
        "rostopic ": "needs two machines and a master: tests/integration/ros/test_ros_names.py",
        "rosrun dynamic_reconfigure ": "needs a master: "
        "tests/integration/ros/test_ros_parameters.py",
        "rosbag ": "needs a master: tests/integration/ros/test_evaluate_performance.py",
        "rosrun rtcf ": "needs a bag: tests/integration/ros/test_evaluate_performance.py",
    },
    "scope.md": {
        "rtcfctl scope ": "runs until Ctrl-C: tests/integration/scope/test_scope.py",
        "sudo ": "needs the unit of the package",
        "curl ": "needs the unit of the package",
    },
    "security.md": {"journalctl ": _BOOTED},
    "signals.md": {
        "sudo rtcfctl trace ": "needs tracefs: tests/integration/signals/test_trace_kernel.py"
    },
    "simulation.md": {
        "rosparam ": "needs a master: tests/integration/loop/test_sim_time.py",
        "rosbag play ": "needs a master: tests/integration/loop/test_sim_time.py",
    },
}


def page_name(page: Path) -> str:
    """Return the name of a page, with its folder below docs/: "control/pid.md"."""
    return page.relative_to(TREE / "docs" if page.parent != TREE else TREE).as_posix()


def typed(name: str) -> list[str]:
    """Return the commands of a page that run in a build tree."""
    (page,) = (each for each in PAGES if page_name(each) == name)
    elsewhere = tuple(ELSEWHERE.get(name, {}))
    return [line for line in shell_lines(page.read_text()) if not line.startswith(elsewhere)]


def pages_typed() -> list[str]:
    """Return the names of the pages with commands that run in a build tree."""
    return [name for name in map(page_name, PAGES) if typed(name)]
