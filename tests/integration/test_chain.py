"""A thousand components in one loop."""

import random
from collections.abc import Iterator

import fig_1
import pytest
import rtcf
from daemon_process import Daemon, wait_for
from rtcf.v1 import control_pb2, runner_pb2
from values import iteration, port_value

COUNT = 1000


def _names() -> list[str]:
    """Return names whose alphabet has nothing to do with their place in the chain."""
    names = [f"c{index}" for index in range(COUNT)]
    random.Random(1).shuffle(names)
    return names


@pytest.fixture
def chain(client: rtcf.Client) -> Iterator[list[str]]:
    """Load Mimo in a chain, each of which adds the 1 that the first one sends to all."""
    names = _names()
    wires: dict[str, dict[str, str]] = {
        names[0]: {"out1": "/link0", "out2": "/one"},
        **{
            name: {"in1": f"/link{place - 1}", "in2": "/one", "out1": f"/link{place}"}
            for place, name in enumerate(names)
            if place > 0
        },
    }
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=100.0))
    in_any_order = sorted(names)
    for name in in_any_order:
        client.load(fig_1.mimo(name, wires[name]))
    yield names


def test_a_thousand_components_run_in_the_order_of_their_chain(
    client: rtcf.Client, daemon: Daemon, chain: list[str]
) -> None:
    order = [f"/{name}" for name in chain]
    assert client.get_order() == order
    assert daemon.ctl("order").stdout.split() == order

    client.step(1)
    # Each value has gone through the whole chain in one cycle.
    assert port_value(client, chain[-1], "out1") == COUNT
    client.step(9)
    assert port_value(client, chain[COUNT // 2], "out1") == COUNT // 2 + 1

    client.start()
    wait_for(lambda: iteration(client) >= 100, "100 cycles")
    assert port_value(client, chain[-1], "out1") == COUNT
    statistics = client.get_statistics()
    assert [each.component for each in statistics.components] == order
    client.stop()

    # A ring of a thousand is refused, and named port by port.
    ring = [control_pb2.PortName(component=chain[0], port="in1")]
    client.set_breaks(ring, True)
    with pytest.raises(rtcf.RefusedError, match=rf"/{chain[-1]}\.out1 → /{chain[0]}\.in1"):
        client.replace(
            chain[0],
            rtcf.component(
                "rtcf_examples",
                "Mimo",
                remaps=[f"in1:=/link{COUNT - 1}", "out1:=/link0", "out2:=/one"],
                breaks=["in4"],
            ),
        )
    assert client.get_order() == order
