"""A thousand components in one loop."""

import random
import re
from collections.abc import Iterator
from dataclasses import dataclass

import fig_1
import pytest
import rtcf
from daemon_process import Daemon, wait_for
from rtcf.v1 import runner_pb2
from values import iteration, port_value

COUNT = 1000


def _names() -> list[str]:
    """Return names whose alphabet has nothing to do with their place in the chain."""
    names = [f"c{index}" for index in range(1, COUNT)]
    random.Random(1).shuffle(names)
    return ["one", *names]


@dataclass(frozen=True)
class Chain:
    """A daemon with the chain loaded; shared, as that takes a while."""

    daemon: Daemon
    client: rtcf.Client
    names: list[str]


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chain]:
    """Load Mimo in a chain, each of which adds the 1 that `one` sends to all."""
    names = _names()
    wires: dict[str, dict[str, str]] = {
        "one": {"out1": "/one"},
        **{
            name: {"in1": f"/link{place - 1}", "in2": "/one", "out1": f"/link{place}"}
            for place, name in enumerate(names)
            if place > 0
        },
    }
    daemon = Daemon(tmp_path_factory.mktemp("chain"))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=100.0))
        for name in sorted(names):
            client.load(fig_1.mimo(name, wires[name]))
        yield Chain(daemon, client, names)
    daemon.end()


def test_a_thousand_components_run_in_the_order_of_their_chain(chain: Chain) -> None:
    client, names = chain.client, chain.names
    order = [f"/{name}" for name in names]
    assert client.get_order() == order
    assert chain.daemon.ctl("order").stdout.split() == order

    client.step(1)
    # Each value has gone through the whole chain in one cycle.
    assert port_value(client, names[-1], "out1") == COUNT
    client.step(9)
    assert port_value(client, names[COUNT // 2], "out1") == COUNT // 2 + 1

    client.start()
    wait_for(lambda: iteration(client) >= 100, "100 cycles")
    assert port_value(client, names[-1], "out1") == COUNT
    statistics = client.get_statistics()
    assert [each.component for each in statistics.components] == order
    client.stop()


def test_a_ring_of_a_thousand_is_refused_in_a_line_that_can_be_read(chain: Chain) -> None:
    client, names = chain.client, chain.names
    # /link0 is what the first link reads, and nobody writes yet.
    closing = [f"in1:=/link{COUNT - 2}", "in2:=/one", f"out1:=/link{COUNT - 1}", "out2:=/link0"]
    last = rtcf.component("rtcf_examples", "Mimo", name=names[-1], remaps=closing)
    with pytest.raises(rtcf.RefusedError) as refused:
        client.replace(names[-1], last)
    line = str(refused.value)
    assert f"{COUNT - 1 - 20} more connections" in line
    assert len(line) < 3000
    assert client.get_order() == [f"/{name}" for name in names]
    # The first way out that it names is one.
    (port, *_) = re.findall(r"`rtcfctl break (\S+)`", line)
    assert chain.daemon.ctl("break", port).returncode == 0
    client.replace(names[-1], last)
