"""The commands of each page, typed by a user of a booted Debian with rtcf's packages."""

import shlex
from collections.abc import Callable
from pathlib import PurePosixPath

import pages
import pytest
from documentation_commands import pages_typed, typed
from machine import Machine, wait_for
from rtcf_service import Service

COMPILE_DEADLINE_S = 900.0
ONE_WAVE = "rtcfctl load rtcf_examples Wave --name wave"
BAG = """
import rosbag, rospy
from std_msgs.msg import Float64
with rosbag.Bag("run.bag", "w") as bag:
    for second, value in enumerate((0.5, 1.5), start=1_700_000_000):
        bag.write("/in", Float64(value), rospy.Time(second))
"""


class Visit:
    """A user's visit: a folder of her own, a shell, and private daemons that she leaves running."""

    def __init__(self, machine: Machine, name: str) -> None:
        self.machine = machine
        self.folder = PurePosixPath("/home/alice") / name.replace("/", "-").removesuffix(".md")
        self._socket = ""
        self._left: list[str] = []
        machine.run("mkdir", str(self.folder), user="alice")

    def file(self, name: str, text: str) -> None:
        """Write a file of a page."""
        place = shlex.quote(str(self.folder / name))
        script = f"mkdir -p $(dirname {place}) && cat >{place}"
        self.machine.run("bash", "-c", script, user="alice", text=text)

    def type(self, line: str) -> None:
        """Run a command line; a daemon and a watch stay until leave()."""
        words = shlex.split(line)
        if words[:2] == ["rtcfd", "--foreground"]:
            self.begin_private(line)
        elif "--watch" in words:
            self._leave_running(line)
            wait_for(lambda: self.tells("rtcfctl info Observer"), "the component")
        else:
            self._shell(line)

    def begin_private(self, line: str) -> None:
        """Run a command with a private daemon, which the next commands use."""
        self._leave_running(line)
        words = shlex.split(line)
        self._socket = words[words.index("--socket") + 1]
        wait_for(lambda: self.tells("rtcfctl status"), "the private rtcfd")

    def leave(self) -> None:
        """End the commands that run."""
        for unit in reversed(self._left):
            self.machine.run("systemctl", "stop", unit)

    def tells(self, line: str) -> bool:
        """Return whether a command line succeeds."""
        return self._shell(line, check=False)

    def _shell(self, line: str, check: bool = True) -> bool:
        socket = f"export RTCF_SOCKET={self._socket}; " if self._socket else ""
        done = self.machine.shell(
            f"cd {self.folder}; {socket}{line}", user="alice", check=check,
            deadline_s=COMPILE_DEADLINE_S,
        )  # fmt: skip
        return done.returncode == 0

    def _leave_running(self, line: str) -> None:
        self._left.append(f"page-{len(self._left)}.service")
        self.machine.run(
            "systemd-run", "--quiet", "--uid=alice", f"--unit={self._left[-1]}",
            f"--working-directory={self.folder}", "--setenv=HOME=/home/alice",
            "--property=KillSignal=SIGINT", "bash", "-c", f"exec {line}",
        )  # fmt: skip


def _graph_file(name: str) -> Callable[[Visit], None]:
    def prepare(visit: Visit) -> None:
        for line in (ONE_WAVE, f"rtcfctl save {name}", "rtcfctl unload wave"):
            visit.type(line)

    return prepare


def _tuned_wave(visit: Visit) -> None:
    visit.type(f"{ONE_WAVE} --param amplitude:=1.5")
    visit.type("rtcfctl set wave amplitude:=2.5")


def _loop_with_a_bag(visit: Visit) -> None:
    visit.type("rtcfctl load rtcf_examples Identity --remap in:=/in --remap out:=/out")
    visit.type("rtcfctl runner set --whitelist /out")
    visit.file("bag.py", BAG)
    visit.type("/usr/bin/python3 bag.py")


def _files(page: str, *wanted: tuple[str, str, str]) -> Callable[[Visit], None]:
    def prepare(visit: Visit) -> None:
        for name, language, holding in wanted:
            visit.file(name, pages.block(page, language, holding))

    return prepare


def _robot(visit: Visit) -> None:
    _files("robot.md", ("velocity_pi.py", "python", "VelocityPi"))(visit)
    # As the page says: only a private daemon loads a source file.
    visit.begin_private(f"rtcfctl --socket {visit.folder}/s run /usr/share/rtcf_arm/arm.yaml")


# Setup that a page assumes.
PREPARE: dict[str, Callable[[Visit], None]] = {
    "components.md": _files(
        "components.md", ("src/pi.cpp", "cpp", "class Pi "), ("CMakeLists.txt", "cmake", "project(")
    ),
    "control/motor.md": _files(
        "control/motor.md",
        ("motor.yaml", "yaml", "rt_runner"),
        ("test_motor.py", "python", "Bench"),
    ),
    "graph-files.md": _graph_file("arm.yaml"),
    "mujoco.md": _files("mujoco.md", ("pendulum.xml", "xml", "<mujoco>")),
    "performance.md": _graph_file("fig1.yaml"),
    "python-components.md": _files("python-components.md", ("observer.py", "python", "class Obs")),
    "robot.md": _robot,
    "security.md": _tuned_wave,
    "simulation.md": _loop_with_a_bag,
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("page", pages_typed())
def test_the_commands_of_a_page_succeed_as_installed(service: Service, page: str) -> None:
    visit = Visit(service.machine, page)
    try:
        PREPARE.get(page, lambda _: None)(visit)
        for line in typed(page):
            visit.type(line)
            if "1e9" in line:  # the fault of the robot
                wait_for(lambda: visit.tells("rtcfctl incident show"), "the incident")
    finally:
        visit.leave()
