"""Two machines joined by a cable: network namespaces joined by veth.

Each has its own host name, addresses and loopback; files, unix sockets and processes are
those of this machine. Requires root.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from daemon_process import DEADLINE_S, clean_environment, wait_for
from ros_processes import reserve_port

_PORT = "cable"  # name of the interface in both machines


class Machine:
    """A network and a host name, kept by a sleeping process."""

    def __init__(self, name: str, address: str) -> None:
        self.name = name
        self.address = address
        self._processes: list[subprocess.Popen[bytes]] = []
        keeper = subprocess.Popen(
            ["unshare", "--net", "--uts", "sh", "-c", f"hostname {name} && exec sleep infinity"],
            stderr=subprocess.PIPE,
        )
        self._processes.append(keeper)
        self.pid = keeper.pid
        self.enter = ("nsenter", "--target", str(self.pid), "--net", "--uts")

        def ready() -> bool:
            if keeper.poll() is not None:
                assert keeper.stderr is not None
                raise AssertionError(
                    f"no network namespace for {name}; this test needs root and a kernel "
                    f"that has them: {keeper.stderr.read().decode()}"
                )
            ours, its = (os.stat(f"/proc/{pid}/ns/net").st_ino for pid in ("self", self.pid))
            return ours != its and self.run("hostname").strip() == name

        wait_for(ready, f"machine {name}")
        self.run("ip", "link", "set", "lo", "up")

    def run(self, *command: str) -> str:
        """Run a command there; return its output."""
        done = subprocess.run(
            [*self.enter, *command], capture_output=True, text=True, timeout=DEADLINE_S, check=False
        )
        assert done.returncode == 0, f"{' '.join(command)} on {self.name}: {done.stderr}"
        return done.stdout

    def start(self, folder: Path, *command: str, **environment: str) -> None:
        """Start a command there that ends with the machine."""
        with (folder / f"{self.name}.log").open("ab") as log:
            self._processes.append(
                subprocess.Popen(
                    [*self.enter, *command],
                    env=clean_environment() | environment,
                    cwd=folder,
                    stdout=log,
                    stderr=log,
                )
            )

    def start_master(self, folder: Path) -> str:
        """Start a ROS master there that the other machine can reach; return its URI."""
        port = reserve_port()
        uri = f"http://{self.address}:{port}"
        self.start(
            folder,
            *("/usr/bin/rosmaster", "--core", "-p", str(port)),
            ROS_MASTER_URI=uri,
            ROS_IP=self.address,
            ROS_HOME=str(folder / "ros"),
            ROS_LOG_DIR=str(folder / "ros" / "log"),
        )
        asked = f"import rosgraph; print(rosgraph.is_master_online('{uri}'))"
        wait_for(
            lambda: self.run(sys.executable, "-c", asked) == "True\n", f"a ROS master at {uri}"
        )
        return uri

    def plug(self, other: "Machine") -> None:
        """Connect the cable to another machine."""
        peer = (*("type", "veth", "peer", "name", _PORT), *("netns", str(other.pid)))
        self.run("ip", "link", "add", _PORT, *peer)
        for machine in (self, other):
            machine.run("ip", "address", "add", f"{machine.address}/24", "dev", _PORT)
            machine.run("ip", "link", "set", _PORT, "up")

    def set_port(self, state: str) -> None:
        """Set this end of the cable to `up` or `down`; the other end loses the carrier."""
        self.run("ip", "link", "set", _PORT, state)

    def swallow(self, swallows: bool) -> None:
        """Drop or forward all packets on the cable, without either end noticing."""
        kind = ("replace", "dev", _PORT, "root", "blackhole")
        self.run("tc", "qdisc", *(kind if swallows else ("del", "dev", _PORT, "root")))

    def end(self) -> None:
        """End all processes of the machine; its network ends with them."""
        for process in reversed(self._processes):
            process.terminate()
            process.wait(DEADLINE_S)


@contextmanager
def two_machines() -> Iterator[tuple[Machine, Machine]]:
    """Yield two machines that reach each other."""
    machines: list[Machine] = []
    try:
        for name, number in (("left", 1), ("right", 2)):
            machines.append(Machine(name, f"10.99.0.{number}"))
        machines[0].plug(machines[1])
        yield machines[0], machines[1]
    finally:
        for machine in machines:
            machine.end()
