"""A loop on each of two machines, one ROS master, topics between them, and a broken cable."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from rtcf.v1 import runner_pb2
from two_machines import Machine, two_machines
from values import iteration, port_value, state, wait_until_after

FREQUENCY_HZ = 500.0
# So long that TCP alone, which doubles the pause before each attempt, needs 23 s more: it
# tries 25 s after the cut, and then after 51 s.
CUT_S = 27.0
# Less than that. docs/ros.md promises 5 s on a machine with spare CPU time.
AGAIN_S = 20.0


class Half:
    """A machine with its daemon and its loop, whose text is sent to the other."""

    def __init__(self, machine: Machine, folder: Path, master_uri: str, other: str) -> None:
        self.machine = machine
        self.component = f"/{machine.name}/text"
        folder = folder / machine.name
        folder.mkdir()
        self.daemon = Daemon(
            folder,
            with_ros(master_uri, ".*/said"),
            wrapper=machine.enter,
            environment={"ROS_HOSTNAME": machine.address},
        )
        self.daemon.start()
        self.client = rtcf.Client(self.daemon.socket)
        self.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ))
        self.client.load(
            rtcf.component(
                *("rtcf_test_ros", "Text"),
                name="text",
                ns=f"/{machine.name}",
                remaps=[f"heard:=/{other}/said"],
            )
        )
        self.client.start()

    def age_s(self) -> float:
        """Return the age of the newest text from the other machine."""
        return port_value(self.client, self.component, "age") * 1e-9

    def is_deaf(self) -> bool:
        """Return whether no text of the other machine has arrived for a long time."""
        return self.age_s() > CUT_S

    def hears(self) -> bool:
        """Return whether the other machine's text arrives."""
        return 0.0 <= self.age_s() < 0.5

    def is_registered(self) -> bool:
        """Return whether its node is registered at the master."""
        return bool(state(self.client).ros.connected)

    def end(self) -> None:
        """End the loop and its daemon."""
        self.client.close()
        self.daemon.end()


@pytest.fixture
def halves(tmp_path: Path) -> Iterator[tuple[Half, Half]]:
    """Yield two loops that receive each other's text."""
    with ExitStack() as stack:
        left, right = stack.enter_context(two_machines())
        uri = left.start_master(tmp_path)
        halves = []
        for machine, other in ((left, "right"), (right, "left")):
            halves.append(Half(machine, tmp_path, uri, other))
            stack.callback(halves[-1].end)
        for half in halves:
            wait_for(half.hears, f"{half.component} to receive the other's text")
        yield halves[0], halves[1]


def _unplug(left: Machine, right: Machine, cut: bool) -> None:
    """Remove the route of one machine, and the carrier of the other."""
    right.set_port("down" if cut else "up")


def _swallow(left: Machine, right: Machine, cut: bool) -> None:
    """Drop all packets, unnoticed by both machines."""
    for machine in (left, right):
        machine.swallow(cut)


@pytest.mark.parametrize("way", [_unplug, pytest.param(_swallow, marks=pytest.mark.long)])
def test_loops_survive_a_broken_cable_and_reconnect(
    halves: tuple[Half, Half], way: Callable[[Machine, Machine, bool], None]
) -> None:
    machines = halves[0].machine, halves[1].machine
    before = [iteration(half.client) for half in halves]
    way(*machines, True)
    for half in halves:
        wait_for(half.is_deaf, f"{half.component} to notice that no message arrives")
    # The machine without a master reports it.
    wait_for(lambda: "answer" in state(halves[1].client).ros.problem, "its status to say so")
    for half, cycle in zip(halves, before, strict=True):
        wait_until_after(half.client, cycle + int(CUT_S * FREQUENCY_HZ / 2))
        assert state(half.client).state == runner_pb2.RUNNER_STATE_RUNNING
    way(*machines, False)
    begin = time.monotonic()
    for half in halves:
        wait_for(half.hears, f"{half.component} to receive the other's text again", AGAIN_S)
        print(f"{half.component} hears the other again after {time.monotonic() - begin:.2f} s")
    for half in halves:
        wait_for(half.is_registered, "the node to be registered")
        assert state(half.client).state == runner_pb2.RUNNER_STATE_RUNNING
