"""The cycles of a stream that are kept around a condition."""

import numpy as np
from numpy.typing import NDArray
from rtcf.recording.moment import Moment
from rtcf.v1 import ports_pb2
from rtcf_shared.ports import PortBatch, PortSchema


class _At:
    """A condition that is true in one cycle."""

    def __init__(self, cycle: int) -> None:
        self._cycle = cycle

    def where(self, batch: PortBatch) -> NDArray[np.bool_]:
        found: NDArray[np.bool_] = batch.cycles == self._cycle
        return found


def _batch(first: int, count: int, lost: int = 0, last: bool = False) -> PortBatch:
    """Return cycles of 1 ms."""
    message = ports_pb2.PortBatch(
        first_cycle=first,
        last_of_loop=last,
        stamps_ns=[1_000_000 * (first + i) for i in range(count)],
        latencies_ns=[0] * count,
        durations_ns=[0] * count,
    )
    return PortBatch(PortSchema(), 1, first, lost, False, message)


def test_only_the_requested_span_is_kept_even_if_cycles_were_dropped() -> None:
    moment = Moment(_At(9_005), pre_s=0.1, post_s=0.01)  # type: ignore[arg-type]
    kept: list[PortBatch] = []
    for first in range(0, 10_000, 10):
        if first == 500:
            assert not moment.take(_batch(first, 0, lost=7))
        kept += moment.take(_batch(first, 10))
    cycles = [int(cycle) for batch in kept for cycle in batch.cycles]
    assert cycles == list(range(8_905, 9_016))


def test_it_ends_with_the_loop() -> None:
    moment = Moment(_At(5), pre_s=0.1, post_s=60.0)  # type: ignore[arg-type]
    assert moment.take(_batch(0, 10)) and not moment.over
    (end,) = moment.take(_batch(10, 10, last=True))
    assert len(end) == 10 and moment.over
    # The same for a condition in the loop's last cycles; an earlier end does not count.
    moment = Moment(_At(5), pre_s=0.1, post_s=60.0)
    assert not moment.take(_batch(0, 3, last=True)) and not moment.over
    assert moment.take(_batch(0, 10, last=True)) and moment.over
