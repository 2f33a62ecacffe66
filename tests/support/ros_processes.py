"""A private ROS master and its nodes, each a process."""

import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
import xmlrpc.client
from pathlib import Path
from typing import Any

import rosgraph
import yaml
from daemon_process import DEADLINE_S, clean_environment, wait_for

_PEER = Path(__file__).with_name("peer.py")


_RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
_reserved: list[socket.socket] = []  # until this process ends


def reserve_port() -> int:
    """Return a TCP port that is reserved for this process, even while nothing listens on it.

    It is outside the kernel's range for outgoing connections. Other tests on this machine see
    that its name is taken.
    """
    lowest, highest = map(int, _RANGE.read_text().split())
    ports: list[int] = [*range(10_000, lowest), *range(highest + 1, 65_536)]
    random.shuffle(ports)
    for port in ports:
        name = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            with socket.socket() as probe:
                name.bind(f"\0rtcf-test-port-{port}")
                # Old connections may linger, as for a server that restarts.
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(("", port))
                probe.listen()
        except OSError:
            name.close()
            continue
        _reserved.append(name)
        return port
    raise AssertionError(f"no port outside of {lowest} to {highest} ({_RANGE}) is free")


class Master:
    """roscore with its files in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.port = reserve_port()
        self.uri = f"http://localhost:{self.port}"
        self._folder = folder
        self._log = folder / "roscore.log"
        self._process: subprocess.Popen[bytes] | None = None
        self._nodes: list[Node] = []

    def start(self) -> None:
        """Start it and wait until it answers."""

        def answers() -> bool:
            # roscore waits less long for its own master than a busy machine needs.
            if self._process is None or self._process.poll() is not None:
                self._launch()
            return bool(rosgraph.is_master_online(self.uri))

        wait_for(answers, f"a ROS master at {self.uri}")

    def _launch(self) -> None:
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                ["/usr/bin/roscore", "-p", str(self.port)],
                env=self.environment() | {"PYTHONUNBUFFERED": "1"},
                cwd=self._folder,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def end(self) -> None:
        """End it, and nodes that a failed test leaves running."""
        for node in self._nodes:
            node.kill()
        assert self._process is not None
        # The master answers before roscore has started to watch it. Later, roscore's exit status
        # depends on whether the signal interrupted an action; it is ignored.
        wait_for(lambda: "started core service" in self._log.read_text(), "the start of roscore")
        self._process.send_signal(signal.SIGINT)
        self._process.wait(DEADLINE_S)

    def environment(self) -> dict[str, str]:
        """Return the environment of the master and its nodes."""
        return clean_environment() | {
            "ROS_MASTER_URI": self.uri,
            "ROS_HOSTNAME": "localhost",
            "ROS_HOME": str(self._folder / "ros"),
            "ROS_LOG_DIR": str(self._folder / "ros" / "log"),
        }

    def run(self, *command: str, ok: bool = True) -> str:
        """Run a command of ROS; return its output."""
        done = subprocess.run(
            command,
            # dynparam uses the first python3 on PATH, which must be Debian's.
            env=self.environment() | {"PATH": f"/usr/bin:{os.environ['PATH']}"},
            cwd=self._folder,
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )
        assert (done.returncode == 0) == ok, done.stdout + done.stderr
        return done.stdout

    def call(self, service: str, request: str = "{}") -> Any:
        """Call a service; return its answer."""
        return yaml.safe_load(self.run("rosservice", "call", service, request))

    def services(self) -> set[str]:
        """Return the registered services."""
        return {name for name, _ in rosgraph.Master("/test", self.uri).getSystemState()[2]}

    def parameter(self, name: str) -> Any:
        """Return a parameter's value; None if it is not set."""
        try:
            return rosgraph.Master("/test", self.uri).getParam(name)
        except rosgraph.MasterError:
            return None

    def topics(self) -> tuple[set[str], set[str]]:
        """Return the published and the subscribed topics."""
        state = rosgraph.Master("/test", self.uri).getSystemState()
        return {topic for topic, _ in state[0]}, {topic for topic, _ in state[1]}

    def subscribers(self, topic: str) -> set[str]:
        """Return the nodes that have registered a subscription of a topic."""
        _, subscribed, _ = rosgraph.Master("/test", self.uri).getSystemState()
        return {node for name, nodes in subscribed if name == topic for node in nodes}

    def listeners(self, node: str, topic: str) -> set[str]:
        """Return the nodes that now receive a node's messages on a topic, as the node reports."""
        uri = rosgraph.Master("/test", self.uri).lookupNode(node)
        asked: Any = xmlrpc.client.ServerProxy(uri)
        _, _, connections = asked.getBusInfo("/test")
        return {each[1] for each in connections if (each[2], each[4]) == ("o", topic)}

    def node(self, *arguments: str) -> "Node":
        """Start a node of peer.py."""
        node = Node(self.environment(), self._folder, *arguments)
        self._nodes.append(node)
        return node


class Node:
    """A rospy node, see peer.py; its output goes to a file."""

    def __init__(self, environment: dict[str, str], folder: Path, *arguments: str) -> None:
        self._output = folder / f"node-{time.monotonic_ns()}"
        with self._output.open("wb") as output:
            self._process = subprocess.Popen(
                [sys.executable, str(_PEER), *arguments],
                env=environment,
                cwd=folder,
                stdin=subprocess.PIPE,
                stdout=output,
                text=True,
            )

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def wait_until_connected(self) -> None:
        """Wait until it reports its connection."""
        wait_for(lambda: "connected" in self._lines(), "the node's connection")

    def wait_for_values(self, count: int) -> None:
        """Wait until it has received `count` values."""
        wait_for(lambda: len(self.values()) >= count, f"{count} messages")

    def values(self) -> list[float]:
        """Return the values received so far."""
        return [float.fromhex(line) for line in self._lines() if line != "connected"]

    def records(self) -> list[dict[str, Any]]:
        """Return the log records received so far."""
        return [json.loads(line) for line in self._lines() if line.startswith("{")]

    def tell(self, line: str) -> None:
        """Give it a line of input."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def end(self) -> None:
        """End it."""
        self._process.send_signal(signal.SIGTERM)
        assert self._process.wait(DEADLINE_S) == 0

    def kill(self) -> None:
        """Kill it if it still runs."""
        self._process.kill()
        self._process.wait()

    def _lines(self) -> list[str]:
        # The last line may be incomplete.
        return self._output.read_text().split("\n")[:-1]
