"""Fig. 1 of the paper: its order, and every value that it sends to ROS."""

import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import fig_1
import pytest
import rtcf
from daemon_process import Daemon, wait_for, wait_until_it_is, with_ros
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import is_among, iteration

MESSAGES = 6000
FREQUENCY_HZ = 2000.0


@pytest.fixture
def ros_daemon(tmp_path: Path, master: Master) -> Iterator[Daemon]:
    daemon = Daemon(tmp_path, with_ros(master.uri, fig_1.WHITELIST))
    daemon.start()
    yield daemon
    daemon.end()


# Each component is loaded first once, and last once.
@pytest.mark.parametrize(
    "names",
    ["H1 F1 R1 R2 R3", "R3 R2 R1 F1 H1", "F1 R2 H1 R3 R1", "R1 H1 R3 F1 R2", "R2 R3 F1 H1 R1"],
)
def test_the_order_does_not_depend_on_the_order_of_loading(daemon: Daemon, names: str) -> None:
    for name in names.split():
        remaps = itertools.chain.from_iterable(
            ("--remap", f"{port}:={fig_1.WIRES[name].get(port, f'~{port}')}")
            for port in fig_1.PORTS
        )
        first = ["--first"] * (name == "H1")
        done = daemon.ctl("load", "rtcf_examples", "Mimo", "--name", name, *remaps, *first)
        assert (done.returncode, done.stderr) == (0, "")
    assert daemon.ctl("order").stdout.split() == fig_1.ORDER


def test_ros_receives_each_value_of_an_independent_simulation(
    ros_daemon: Daemon, master: Master
) -> None:
    with rtcf.Client(ros_daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ))
        fig_1.load(client, ("R3", "F1", "R2", "H1", "R1"))
        g1 = master.node("record", "/R1_H1R2")
        g2 = master.node("record", "/R3_G2H1")
        # A value that needs all digits of a double. It comes before the start, so it is not new in
        # the loop.
        latched = master.node("latch", "/G2_R2", "0.1")
        for node in (g1, g2, latched):
            node.wait_until_connected()

        wait_for(lambda: _in4_of_r2(ros_daemon) == 0.1, "G2's value while the loop is stopped")
        assert iteration(client) == 0

        client.start()
        wait_for(lambda: iteration(client) >= MESSAGES, f"{MESSAGES} cycles")
        client.stop()
        cycles = iteration(client)
        # Half a second of values waits for a thread that a busy machine may delay longer. Lost
        # values are counted; all others arrive.
        lost = client.get_status("rt_runner").runners[0].tap_dropped
        assert lost < cycles
        wait_until_it_is(
            2 * cycles - lost, lambda: len(g1.values()) + len(g2.values()), "the values received"
        )
        wanted = list(itertools.islice(fig_1.simulate(), cycles))
        assert is_among(g2.values(), [values["R3"] for values in wanted])
        assert is_among(g1.values(), [values["R1"] for values in wanted])
        # The sums grow and restart repeatedly, so the values differ.
        assert len({values["R3"] for values in wanted}) > 20
        for node in (g1, g2, latched):
            node.end()


def _in4_of_r2(daemon: Daemon) -> float | None:
    done = daemon.ctl("info", "R2", "-o", "json")
    assert done.returncode == 0, done.stderr
    (port,) = (port for port in json.loads(done.stdout)["ports"] if port["name"] == "in4")
    return None if port["value"] is None else float(port["value"]["data"])
