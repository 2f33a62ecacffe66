"""The cycles around one in which something is so: what came before is kept until then."""

from collections import deque
from itertools import islice

from rtcf.streams.condition import Condition
from rtcf.streams.ports import PortBatch

MOST_BYTES = 512 * 1024 * 1024  # of values that are kept before


class Moment:
    """Waits for a condition in a stream; then gives what was `pre_s` before and is until `post_s`
    after, by the loop's time stamps."""

    def __init__(
        self, condition: Condition, pre_s: float, post_s: float, most_bytes: int = MOST_BYTES
    ) -> None:
        self.cycle: int | None = None  # in which the condition was true
        self.over = False  # all of it has come, or the loop has ended
        self.cut = False  # more came before than may be kept
        self.condition = condition
        self._pre_ns, self._post_ns = round(pre_s * 1e9), round(post_s * 1e9)
        self._most = most_bytes
        self._before: deque[PortBatch] = deque()
        self._bytes = 0
        self._until_ns = 0

    def take(self, batch: PortBatch) -> list[PortBatch]:
        """Return what belongs to it, now that this has come.  Raises ConditionError."""
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
        # One more than is needed: of the first one a part may be.
        newest_ns = batch.message.stamps_ns[-1] if len(batch) else 0
        while len(self._before) > 1 and (
            self._bytes > self._most or self._second_begins_before(newest_ns - self._pre_ns)
        ):
            self.cut |= self._bytes > self._most
            self._bytes -= _size(self._before.popleft())

    def _second_begins_before(self, stamp_ns: int) -> bool:
        """Tell whether the first batch is not needed for what is from a time on.  Some have no
        cycles: they tell of lost ones."""
        second = next((each for each in islice(self._before, 1, None) if len(each)), None)
        return second is not None and second.message.stamps_ns[0] < stamp_ns

    def _end(self, batch: PortBatch) -> PortBatch:
        if not len(batch):
            return batch
        late = int((batch.stamps_ns > self._until_ns).sum())
        # Another loop's cycles are of another story.
        self.over = late > 0 or batch.message.last_of_loop
        return batch.part(0, len(batch) - late)


def _size(batch: PortBatch) -> int:
    return sum(len(each) for each in batch.message.values) + 48 * len(batch) + 1000
