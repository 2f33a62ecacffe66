"""A thousand components in one loop."""

import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import fig_1
import pytest
import rtcf
from daemon_process import NO_ROS, Daemon, wait_for
from rtcf.v1 import graph_pb2, runner_pb2
from values import iteration, port_value

COUNT = 1000


def _names(count: int = COUNT) -> list[str]:
    """Return names whose alphabetical order is unrelated to their order in the chain."""
    names = [f"c{index}" for index in range(1, count)]
    random.Random(1).shuffle(names)
    return ["one", *names]


def _specs(names: list[str]) -> list[graph_pb2.ComponentSpec]:
    """Return a chain of Mimo in which each adds the 1 that the first one sends to all."""
    first = fig_1.mimo(names[0], {"out1": "/one"})
    rest = (
        fig_1.mimo(name, {"in1": f"/link{place - 1}", "in2": "/one", "out1": f"/link{place}"})
        for place, name in enumerate(names[1:], 1)
    )
    return sorted([first, *rest], key=lambda spec: spec.name)


@dataclass(frozen=True)
class Chain:
    """A daemon with the chain loaded; shared, because loading takes a while."""

    daemon: Daemon
    client: rtcf.Client
    names: list[str]


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chain]:
    """Load the chain, one component after the other."""
    names = _names()
    daemon = Daemon(tmp_path_factory.mktemp("chain"))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=100.0))
        for spec in _specs(names):
            client.load(spec)
        yield Chain(daemon, client, names)
    daemon.end()


def test_a_thousand_components_run_in_the_order_of_their_chain(chain: Chain) -> None:
    client, names = chain.client, chain.names
    order = [f"/{name}" for name in names]
    assert client.get_order() == order
    assert chain.daemon.ctl("order").stdout.split() == order

    client.step(1)
    # Each value passes the whole chain within one cycle.
    assert port_value(client, names[-1], "out1") == COUNT
    client.step(9)
    assert port_value(client, names[COUNT // 2], "out1") == COUNT // 2 + 1

    client.start()
    wait_for(lambda: iteration(client) >= 100, "100 cycles")
    assert port_value(client, names[-1], "out1") == COUNT
    statistics = client.get_statistics()
    assert [each.component for each in statistics.components] == order
    client.stop()


def test_a_ring_of_a_thousand_is_rejected_in_a_readable_line(chain: Chain) -> None:
    client, names = chain.client, chain.names
    # The first link reads /link0, which has no writer yet.
    closing = [f"in1:=/link{COUNT - 2}", "in2:=/one", f"out1:=/link{COUNT - 1}", "out2:=/link0"]
    last = rtcf.component("rtcf_examples", "Mimo", name=names[-1], remaps=closing)
    with pytest.raises(rtcf.RefusedError) as refused:
        client.replace(names[-1], last)
    line = str(refused.value)
    assert f"{COUNT - 1 - 20} more connections" in line
    assert len(line) < 3000
    assert client.get_order() == [f"/{name}" for name in names]
    # The first suggested command works.
    (port, *_) = re.findall(r"`rtcfctl break (\S+)`", line)
    assert chain.daemon.ctl("break", port).returncode == 0
    client.replace(names[-1], last)


@pytest.mark.parametrize("count", [200, pytest.param(10_000, marks=pytest.mark.long)])
def test_as_many_components_run_as_the_settings_allow(tmp_path: Path, count: int) -> None:
    daemon = Daemon(tmp_path, f"[limits]\ncomponents = {count}\n{NO_ROS}")
    daemon.start()
    names = _names(count)
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=10.0))
        client.apply(_specs(names))
        with pytest.raises(rtcf.RefusedError, match=f"{count}"):
            client.load(rtcf.component("rtcf_test", "Counter", name="more"))
        client.start()
        wait_for(lambda: iteration(client) >= 20, "20 cycles")
        assert port_value(client, names[-1], "out1") == count
        client.stop()
        assert client.get_order() == [f"/{name}" for name in names]
    daemon.end()


@pytest.mark.long
def test_setting_a_parameter_takes_equally_long_in_a_large_graph(tmp_path: Path) -> None:
    shortest = {}
    for count in (5, 4000):
        folder = tmp_path / f"{count}"
        folder.mkdir()
        daemon = Daemon(folder)
        daemon.start()
        with rtcf.Client(daemon.socket) as client:
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=100.0))
            knobs = rtcf.component("rtcf_test", "Knobs", name="knobs")
            client.apply([*_specs(_names(count)), knobs])
            client.start()
            client.reset_statistics()
            for change in range(100):
                client.set_parameters("knobs", [rtcf.parse_parameter(f"rate:={change}")])
            taken = client.get_statistics().adoption
            assert taken.count >= 100
            shortest[count] = taken.min_ns
            print(f"{count} components: {taken.min_ns} ns at least, {taken.p50_ns} ns as a rule")
        daemon.end()
    # 100 changes each, so that the machine's load does not matter; updating all components would
    # take 800 times as long.
    assert shortest[4000] < 20 * shortest[5]
