"""A log of numbered entries for any number of watchers of any speed.

Used on rtcfd's one thread.  A watcher holds only the number of its last entry, so it costs no
memory here.  If entries are deleted before a slow watcher reads them, it learns their number.
"""

import asyncio
import secrets
from collections import deque
from itertools import islice
from typing import Generic, TypeVar

KEPT = 4096

Entry = TypeVar("Entry")


class NumberedLog(Generic[Entry]):
    """The last `kept` entries; the first entry ever has number 1."""

    def __init__(self, kept: int = KEPT) -> None:
        self.log_id = secrets.token_hex(8)
        self.last = 0  # number of the newest entry
        self.ended = False  # no more entries follow
        self._entries: deque[Entry] = deque(maxlen=kept)
        self._news: asyncio.Event | None = None  # set at the next entry; None: nobody waits

    def append(self, entry: Entry) -> None:
        """Append an entry, and wake the watchers."""
        self.last += 1
        self._entries.append(entry)
        self._tell()

    def end(self) -> None:
        """End the log, and wake the watchers."""
        self.ended = True
        self._tell()

    def after(self, number: int, most: int) -> tuple[list[Entry], int]:
        """Return up to `most` entries after a number, the oldest first, and how many are lost.

        The first returned entry has the number `number + lost + 1`.
        """
        first = self.last - len(self._entries) + 1  # number of the oldest kept entry
        lost = max(first - 1 - number, 0)
        begin = number + lost + 1 - first
        return list(islice(self._entries, begin, begin + most)), lost

    async def beyond(self, number: int) -> None:
        """Wait for an entry after a number, or for the end."""
        while self.last <= number and not self.ended:
            if self._news is None:
                self._news = asyncio.Event()
            await self._news.wait()

    def _tell(self) -> None:
        news, self._news = self._news, None
        if news is not None:
            news.set()
