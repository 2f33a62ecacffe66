"""Things that came one after the other, with numbers: for those who watch, however slow they are.

On rtcfd's one thread.  Watchers have a place in it each and nothing else, so that one costs
nothing; who is left behind is told how many were not kept.
"""

import asyncio
import secrets
from collections import deque
from itertools import islice
from typing import Generic, TypeVar

KEPT = 4096

Entry = TypeVar("Entry")


class NumberedLog(Generic[Entry]):
    """The last entries; the first one ever has number 1."""

    def __init__(self, kept: int = KEPT) -> None:
        self.log_id = secrets.token_hex(8)
        self.last = 0  # number of the newest
        self.ended = False  # none will come
        self._entries: deque[Entry] = deque(maxlen=kept)
        self._news: asyncio.Event | None = None  # where somebody waits

    def append(self, entry: Entry) -> None:
        """Take the next entry."""
        self.last += 1
        self._entries.append(entry)
        self._tell()

    def end(self) -> None:
        """Take none any more; who waits for one waits no longer."""
        self.ended = True
        self._tell()

    def after(self, number: int, most: int) -> tuple[list[Entry], int]:
        """Return the entries behind a number, the oldest first, and how many of them were lost:
        the first one's number is behind those."""
        first = self.last - len(self._entries) + 1  # the oldest that is kept
        lost = max(first - 1 - number, 0)
        begin = number + lost + 1 - first
        return list(islice(self._entries, begin, begin + most)), lost

    async def beyond(self, number: int) -> None:
        """Wait for an entry behind a number, or the end."""
        while self.last <= number and not self.ended:
            if self._news is None:
                self._news = asyncio.Event()
            await self._news.wait()

    def _tell(self) -> None:
        news, self._news = self._news, None
        if news is not None:
            news.set()
