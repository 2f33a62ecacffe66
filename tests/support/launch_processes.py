"""roslaunch, rt_runner, rt_launcher and the rosrun tools as processes, with the build tree's
packages; their output goes to files."""

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rosgraph
import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, wait_for
from ros_processes import Master
from rtcf_launch import runner_entry
from rtcf_launch.master import Master as Parameters

_DEVEL = BUILD_TREE / "devel"


def environment(master: Master, system_socket: Path | str = "/nonexistent") -> dict[str, str]:
    """Return the environment of a user who sourced the build tree's setup.sh, with a master."""
    return build_tree_environment(master.environment(), system_socket)


def build_tree_environment(
    base: dict[str, str], system_socket: Path | str = "/nonexistent"
) -> dict[str, str]:
    """Return the environment of a user who sourced the build tree's setup.sh."""
    return base | {
        "CMAKE_PREFIX_PATH": str(_DEVEL),
        "ROS_PACKAGE_PATH": str(_DEVEL / "share"),
        "PYTHONPATH": str(BUILD_TREE / "python"),
        "PATH": f"{BUILD_TREE / 'bin'}:{os.environ['PATH']}",
        "RTCF_SOCKET": str(system_socket),
        "PYTHONUNBUFFERED": "1",
    }


class Process:
    """A process in its own session."""

    def __init__(self, command: list[str], environment: dict[str, str], folder: Path) -> None:
        self.command = " ".join(command)
        self._output = folder / f"output-{time.monotonic_ns()}"
        with self._output.open("wb") as output:
            self._process = subprocess.Popen(
                command,
                env=environment,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        self.pid = self._process.pid

    def output(self) -> str:
        """Return its output so far."""
        return self._output.read_text(errors="replace")

    def wait_for_output(self, text: str) -> None:
        """Wait until its output contains a text."""

        def printed() -> bool:
            there = text in self.output()
            assert there or self._process.poll() is None, self.output()
            return there

        wait_for(printed, f"{text!r} in the output")

    def end(self, number: signal.Signals = signal.SIGINT) -> int:
        """Send a signal; return the exit status."""
        self._process.send_signal(number)
        return self.wait()

    def wait(self, deadline_s: float = DEADLINE_S) -> int:
        """Wait for its end; return the exit status."""
        return self._process.wait(deadline_s)

    def make_sure(self) -> None:
        """Kill it if it still runs."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(DEADLINE_S)
            except subprocess.TimeoutExpired:
                os.killpg(self.pid, signal.SIGKILL)
                self._process.wait()

    def children(self) -> dict[str, int]:
        """Return the nodes started by a roslaunch, by name."""
        found = {}
        for process in Path("/proc").glob("[0-9]*"):
            try:
                fields = (process / "stat").read_text().rpartition(")")[2].split()
                words = (process / "cmdline").read_text().split("\0")
            except OSError:
                continue
            if int(fields[1]) == self.pid:
                for word in words:
                    if word.startswith("__name:="):
                        found[word.removeprefix("__name:=")] = int(process.name)
        return found


class Launching:
    """Starts processes at one master, and ends those that a failed test leaves running."""

    def __init__(self, master: Master, folder: Path, system_socket: Path | str = "/nonexistent"):
        self.master = master
        self.environment = environment(master, system_socket)
        self._folder = folder
        self._processes: list[Process] = []

    def roslaunch(self, *words: str) -> Process:
        """Start roslaunch with a package and a file, or with a file."""
        self.forget()
        # The default gives nodes 15 s to end, which a busy machine may exceed.
        return self.start("/usr/bin/roslaunch", f"--sigint-timeout={DEADLINE_S / 2}", *words)

    def forget(self) -> None:
        """Remove an earlier launch's parameters from the parameter server."""
        server = rosgraph.Master("/test", self.master.uri)
        for name in server.getParam("/"):
            if name not in ("run_id", "roslaunch", "rosversion", "rosdistro"):
                server.deleteParam("/" + name)

    def launch_text(self, text: str) -> Process:
        """Start roslaunch with the text of a launch file."""
        file = self._folder / f"test-{time.monotonic_ns()}.launch"
        file.write_text(text)
        return self.roslaunch(str(file))

    def node(self, program: str, *words: str, **variables: str) -> Process:
        """Start rt_runner or rt_launcher without roslaunch."""
        return self.start(str(_DEVEL / "lib" / "rtcf" / program), *words, **variables)

    def start(self, *command: str, **variables: str) -> Process:
        """Start any process."""
        process = Process(list(command), self.environment | variables, self._folder)
        self._processes.append(process)
        return process

    def tool(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run a rosrun tool."""
        return subprocess.run(
            ["/usr/bin/rosrun", "rtcf", *words],
            env={k: v for k, v in self.environment.items() if k != "RTCF_SOCKET"},
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )

    @contextmanager
    def client(self, node: str = "/rt_runner") -> Iterator[tuple[rtcf.Client, str]]:
        """Yield a client of the rtcfd with a node's runner, and the runner's name."""
        parameters = Parameters(self.master.uri, "/test")

        def found() -> runner_entry.RunnerEntry | None:
            entry = runner_entry.find(parameters, node)
            return None if entry is None or entry.starting else entry

        entry = wait_for(found, f"runner {node}")
        with rtcf.Client(entry.socket) as client:
            yield client, entry.runner

    def end(self) -> None:
        """End all remaining processes; print their output if the test failed."""
        for process in reversed(self._processes):
            process.make_sure()
            print(f"--- {process.command}:\n{process.output()}")


def left_over(marker: str) -> list[str]:
    """Return the command lines of processes that contain a text."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            line = (process / "cmdline").read_text().replace("\0", " ")
        except OSError:
            continue
        if marker in line:
            found.append(line)
    return found
