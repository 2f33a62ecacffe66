"""Which commands of the pages are typed where: in a build tree, or why not there."""

from pages import TREE, shell_lines

PAGES = [TREE / "README.md", *sorted((TREE / "docs").glob("*.md"))]

_APT = "installs packages"
_BOOTED = "types it in a booted Debian: tests/system/test_pages.py"
_LAUNCH = "has a master and a launch: tests/integration/test_launch_files.py"
_BY_BLOCK = "is typed with the lines around it: tests/integration/test_docs.py"
_WORKSPACE = "builds a workspace so: tests/integration/test_old_workspace.py"

# By page: how a line begins, and what else types it, or what it would take.
ELSEWHERE: dict[str, dict[str, str]] = {
    "README.md": {
        "make ": "builds this tree, which a test is part of",
        "sudo apt install ": _APT,
        "sudo adduser ": "changes the machine's accounts",
        "rtcfctl doctor": "tells of the machine by its exit code: tests/unit/python/test_doctor.py",
        "rostopic hz /there": "goes on for ever, and takes a master: test_ros_topics.py",
        "sudo install ": _BOOTED,
        "cmake -S . -B build ": "installs into /usr; components.md's does not, and is typed",
        "rtcfctl load my_package Gain": "is of what was installed into /usr",
    },
    "boot.md": {"sudo ": _BOOTED, "rtcfd --check-config": _BOOTED, "journalctl ": _BOOTED},
    "components.md": {"sudo cmake --install ": "installs into /usr"},
    "from-rtcf-2021.md": {
        "apt install ": _APT,
        "cd my_workspace": _WORKSPACE,
        ". devel": _WORKSPACE,
    },
    "graph.md": {"rtcfctl load my_package Pid": "is of a package of the reader's"},
    "launching.md": {"roslaunch ": _LAUNCH, "rosrun ": _LAUNCH},
    "operating.md": {
        "rtcfctl doctor": "tells of the machine by its exit code: tests/unit/python/test_doctor.py",
        "sudo apt install ": _APT,
    },
    "performance.md": {"sudo perf ": "takes rights that a test may not have"},
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
        "rosservice ": "takes two machines and a master: tests/integration/test_ros_names.py",
        "rostopic ": "takes two machines and a master: tests/integration/test_ros_names.py",
        "rosrun dynamic_reconfigure ": "takes a master: tests/integration/test_ros_parameters.py",
        "rosbag ": "takes a master: tests/integration/test_evaluate_performance.py",
        "rosrun rtcf ": "takes a bag: tests/integration/test_evaluate_performance.py",
    },
    "scope.md": {
        "rtcfctl scope ": "goes on until Ctrl-C: tests/integration/test_scope.py",
        "sudo ": "takes the unit, of the package",
    },
    "security.md": {"journalctl ": _BOOTED},
    "signals.md": {"sudo rtcfctl trace ": "takes tracefs: tests/integration/test_trace_kernel.py"},
    "simulation.md": {
        "rosparam ": "takes a master: tests/integration/test_sim_time.py",
        "rosbag play ": "takes a master: tests/integration/test_sim_time.py",
    },
}


def typed(name: str) -> list[str]:
    """Return the lines of a page that are typed in a build tree."""
    (page,) = (each for each in PAGES if each.name == name)
    elsewhere = tuple(ELSEWHERE.get(name, {}))
    return [line for line in shell_lines(page.read_text()) if not line.startswith(elsewhere)]


def pages_typed() -> list[str]:
    """Return the names of the pages of which something is typed in a build tree."""
    return [page.name for page in PAGES if typed(page.name)]
