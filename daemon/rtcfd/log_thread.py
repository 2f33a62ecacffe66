"""Writes log records in a thread, so that a hanging journal blocks neither the event loop nor the
watchdog.

Owned by the root logger.
"""

import copy
import logging
import queue
import threading
import time

_MOST_WAITING = 20_000  # records in the queue, so that a hanging journal does not fill the memory
_LAST_WORDS_S = 2.0  # longest wait for the queue at the end of rtcfd


class LogThread(logging.Handler):
    """Passes records on to another handler, in a thread; counts records that find no room."""

    def __init__(self, handler: logging.Handler, most: int = _MOST_WAITING) -> None:
        super().__init__()
        self._handler = handler
        self._queue: queue.Queue[logging.LogRecord] = queue.Queue(most)
        self._no_room = 0  # since the start
        threading.Thread(target=self._work, name="rtcfd-log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Queue one record."""
        # Format it now: its arguments may change before it is written.
        kept = copy.copy(record)
        kept.msg, kept.args = record.getMessage(), None
        try:
            self._queue.put_nowait(kept)
        except queue.Full:
            self._no_room += 1

    def flush(self) -> None:
        """Wait until all records are written, at most _LAST_WORDS_S."""
        deadline = time.monotonic() + _LAST_WORDS_S
        while self._queue.unfinished_tasks and time.monotonic() < deadline:
            time.sleep(0.005)

    def close(self) -> None:
        """Write the last records, at the end of the process."""
        self.flush()
        super().close()

    def _work(self) -> None:
        failed = told = 0
        while True:
            record = self._queue.get()
            try:
                failed += not self._written(record)
                lost = self._no_room + failed - told
                if lost and self._queue.empty() and self._written(_report(lost)):
                    told += lost
            finally:
                self._queue.task_done()

    def _written(self, record: logging.LogRecord) -> bool:
        try:
            # Without the handler's lock: only this thread writes, and the end of the process
            # would wait for the lock.
            self._handler.emit(record)
        except Exception:  # logging must not end the daemon
            return False
        return True


def _report(lost: int) -> logging.LogRecord:
    text = f"{lost} log records were lost: the journal or terminal failed, or was too slow"
    return logging.LogRecord("rtcfd", logging.WARNING, "", 0, text, None, None)
