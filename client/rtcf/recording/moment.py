"""The cycles around the first cycle in which a condition is true."""

from collections import deque
from itertools import islice

from rtcf_shared.ports import PortBatch

from rtcf.streams.condition import Condition

MOST_BYTES = 512 * 1024 * 1024  # memory limit of the pre-trigger data


class Moment:
    """Waits for a condition in a stream; returns the cycles from `pre_s` before to `post_s` after.

    Times are by the loop's stamps.
    """

    def __init__(
        self, condition: Condition, pre_s: float, post_s: float, most_bytes: int = MOST_BYTES
    ) -> None:
        self.cycle: int | None = None  # the first cycle in which the condition is true
        self.over = False  # all cycles have been returned, or the loop has ended
        self.cut = False  # pre-trigger data truncated: memory limit reached
        self.condition = condition
        self._pre_ns, self._post_ns = round(pre_s * 1e9), round(post_s * 1e9)
        self._most = most_bytes
        self._before: deque[PortBatch] = deque()
        self._bytes = 0
        self._until_ns = 0

    def take(self, batch: PortBatch) -> list[PortBatch]:
        """Process a batch; return the batches to record now.  Raises ConditionError."""
        if self.over:
            return []
        if self.cycle is not None:
            return [self._end(batch)]
        found = self.condition.where(batch).nonzero()[0]
        if not len(found):
            self._keep(batch)
            return []
        hit = int(found[0])
        self.cycle = batch.first_cycle + hit * batch.every
        stamp_ns = int(batch.message.stamps_ns[hit])
        self._until_ns = stamp_ns + self._post_ns
        self._keep(batch)
        parts = list(self._before)
        self._before.clear()
        begin_ns = stamp_ns - self._pre_ns
        first = parts[0]
        parts[0] = first.part(int((first.stamps_ns < begin_ns).sum()))
        parts[-1] = self._end(parts[-1])
        return parts

    def _keep(self, batch: PortBatch) -> None:
        self._before.append(batch)
        self._bytes += _size(batch)
        # Keep the first batch as long as any of its cycles is in the pre-trigger time.
        newest_ns = batch.message.stamps_ns[-1] if len(batch) else 0
        while len(self._before) > 1 and (
            self._bytes > self._most or self._second_begins_before(newest_ns - self._pre_ns)
        ):
            self.cut |= self._bytes > self._most
            self._bytes -= _size(self._before.popleft())

    def _second_begins_before(self, stamp_ns: int) -> bool:
        """Return whether the first batch has only cycles before a time.

        Batches without cycles, which only report lost ones, are skipped.
        """
        second = next((each for each in islice(self._before, 1, None) if len(each)), None)
        return second is not None and second.message.stamps_ns[0] < stamp_ns

    def _end(self, batch: PortBatch) -> PortBatch:
        if not len(batch):
            return batch
        late = int((batch.stamps_ns > self._until_ns).sum())
        # Do not continue into the next start of the loop.
        self.over = late > 0 or batch.message.last_of_loop
        return batch.part(0, len(batch) - late)


def _size(batch: PortBatch) -> int:
    return sum(len(each) for each in batch.message.values) + 48 * len(batch) + 1000
