"""Values of every cycle, as received by a client."""

import asyncio
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import rtcf
from daemon_process import DEADLINE_S, Daemon, stopped, wait_for
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.streams.ports import PortStream
from rtcf.v1 import graph_pb2, runner_pb2
from rtcf_shared.ports import PortBatch
from rtcfd.executor.link import Link


def _wave(name: str = "wave") -> graph_pb2.ComponentSpec:
    return rtcf.component("rtcf_examples", "Wave", name=name, parameters=["rate:=1.0"])


def _take(stream: PortStream, cycles: int) -> list[PortBatch]:
    """Return batches until they contain `cycles` cycles."""
    batches: list[PortBatch] = []
    for batch in stream:
        batches.append(batch)
        if sum(len(each) for each in batches) >= cycles:
            return batches
    raise AssertionError("the stream has ended")


def test_every_cycle_has_its_values(client: rtcf.Client) -> None:
    client.load(_wave())
    with client.watch_ports(["wave"]) as stream:
        assert set(stream.schema.signals) == {"/wave.wave", "/wave.phase", "/wave.above"}
        client.step(5000)
        batches = _take(stream, 5000)
    assert not any(batch.lost for batch in batches)
    cycles = np.concatenate([batch.cycles for batch in batches])
    assert np.array_equal(cycles, np.arange(5000))
    phase = np.concatenate([batch["/wave.phase"] for batch in batches])
    # 1 Hz at 1 kHz: a thousandth per cycle.
    expected = (np.arange(1, 5001) / 1000) % 1.0
    difference = np.abs(phase - expected)
    assert np.all(np.minimum(difference, 1.0 - difference) < 1e-9)
    wave = np.concatenate([batch["/wave.wave"] for batch in batches])
    assert np.allclose(wave, np.sin(2 * np.pi * phase))
    above = np.concatenate([batch["/wave.above"] for batch in batches])
    assert above.dtype == np.bool_
    assert above.any() and not above.all()


def test_each_nth_cycle_is_sent_on_request(client: rtcf.Client) -> None:
    client.load(_wave())
    with client.watch_ports(["wave.phase"], every=10) as stream:
        assert list(stream.schema.signals) == ["/wave.phase"]
        client.step(1000)
        batches = _take(stream, 100)
    assert np.array_equal(
        np.concatenate([batch.cycles for batch in batches]), np.arange(0, 1000, 10)
    )


def test_graph_changes_are_sent_and_no_cycle_is_missed(client: rtcf.Client) -> None:
    client.load(_wave())
    with client.watch_ports() as stream:
        client.step(100)
        client.load(_wave("second"))
        client.step(100)
        client.unload(["wave"])
        client.step(100)
        batches = _take(stream, 300)
    seen = {int(cycle): set(batch.schema.signals) for batch in batches for cycle in batch.cycles}
    assert list(seen) == list(range(300))
    assert not any(batch.lost for batch in batches)
    both = {"/wave.wave", "/second.wave"}
    assert [seen[cycle] & both for cycle in (99, 100, 199, 200)] == [
        {"/wave.wave"}, both, both, {"/second.wave"},
    ]  # fmt: skip


def test_a_running_loop_is_watched_to_its_last_cycle(client: rtcf.Client) -> None:
    client.load(_wave())
    client.start()
    with client.watch_ports(["wave.phase"]) as stream:
        batches = _take(stream, 50)
        client.stop()
        for batch in stream:
            batches.append(batch)
            if batch.last_of_loop:
                break
    expected = batches[0].first_cycle
    for batch in batches:
        assert batch.first_cycle == expected + batch.lost
        assert np.all(np.diff(batch.stamps_ns) > 0)
        expected = batch.first_cycle + len(batch)
    assert batches[-1].last_of_loop
    assert not any(batch.last_of_loop for batch in batches[:-1])


def test_watchers_are_independent(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(_wave())
    client.load(_wave("second"))
    with rtcf.Client(daemon.socket) as other, client.watch_ports(["wave.phase"]) as first:
        client.step(10)
        with other.watch_ports(["second"]) as second:
            client.step(10)
            assert int(_take(second, 10)[0].cycles[0]) == 10
            assert all(each.startswith("/second.") for each in second.schema.signals)
        client.step(10)
        batches = _take(first, 30)
    assert np.array_equal(np.concatenate([batch.cycles for batch in batches]), np.arange(30))
    assert list(first.schema.signals) == ["/wave.phase"]


def test_cycles_dropped_for_a_slow_reader_are_counted(client: rtcf.Client) -> None:
    client.load(_wave())
    with client.watch_ports() as stream:
        # More than executor, rtcfd and gRPC buffer for a client that does not read.
        cycles = 1_000_000
        client.step(cycles)
        taken = lost = 0
        for batch in stream:
            assert batch.first_cycle == taken + lost + batch.lost
            taken, lost = taken + len(batch), lost + batch.lost
            if taken + lost == cycles:
                break
    assert lost > 0


async def _pass(executor: int, cycles: int) -> None:
    """Query an executor directly until its loop has run for some more cycles."""
    words = Path(f"/proc/{executor}/cmdline").read_text().split("\0")
    link = await Link.connect("it", Path(words[words.index("--socket") + 1]), lambda _: None)

    async def cycle() -> int:
        asked = await link.request(wire.Request(get_status=wire.GetStatus()), DEADLINE_S)
        return int(asked.status.iteration)

    try:
        await link.hello(DEADLINE_S)
        until = await cycle() + cycles
        async with asyncio.timeout(DEADLINE_S):
            while await cycle() < until:
                await asyncio.sleep(0.01)
    finally:
        await link.close()


def test_an_executor_keeps_a_frozen_rtcfd_connected_and_drops_cycles(
    client: rtcf.Client, daemon: Daemon
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=2000.0))
    for number in range(20):
        client.load(_wave(f"wave{number}"))
    client.start()
    executor = client.get_status().runners[0].pid
    with ExitStack() as stack:
        streams = [stack.enter_context(client.watch_ports()) for _ in range(40)]
        with stopped(daemon.pid):
            # More than an executor buffers for an rtcfd that does not read.
            asyncio.run(_pass(executor, 12_000))
        for stream in streams:
            expected = None
            for batch in stream:
                assert expected is None or batch.first_cycle == expected + batch.lost
                if batch.lost:
                    break
                expected = batch.first_cycle + len(batch)


def test_a_stream_ends_when_its_executor_does(client: rtcf.Client) -> None:
    client.load(_wave())
    with client.watch_ports() as stream:
        client.remove_runner("rt_runner")
        with pytest.raises(rtcf.RtcfError):
            next(iter(stream))


@pytest.mark.parametrize(
    ("selection", "said"),
    [
        (
            "nobody.out",
            "nobody.out matches no output of fixed size and no state; available: /wave.",
        ),
        ("wave.nothing", "wave.nothing matches no output"),
        ("", "a selection of ports is empty"),
    ],
)
def test_a_selection_without_matches_is_rejected(
    client: rtcf.Client, selection: str, said: str
) -> None:
    client.load(_wave())
    with pytest.raises(rtcf.RefusedError, match="") as refused:
        client.watch_ports([selection])
    assert said in str(refused.value)


def test_watching_an_empty_runner_includes_later_components(client: rtcf.Client) -> None:
    with client.watch_ports() as stream:
        assert not stream.schema.columns
        client.load(_wave())
        client.step(10)
        batches = _take(stream, 10)
    assert len(batches[-1]["/wave.phase"]) == len(batches[-1])


def test_unwatched_cycles_copy_nothing(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(_wave())
    with client.watch_ports():
        pass
    # An unloaded component's values were copied before: the loop must not access them.
    client.start()
    for _ in range(20):
        with client.watch_ports():
            client.replace("wave", _wave())
        client.replace("wave", _wave())
    before = client.get_status().runners[0].iteration
    wait_for(lambda: client.get_status().runners[0].iteration > before + 100, "100 cycles")
