"""How a command that writes a file until Ctrl-C ends."""

import contextlib
import signal
import threading
from collections.abc import Iterator

from rtcf.streams.ports import PortStream


@contextlib.contextmanager
def ended_by_signals(stream: PortStream) -> Iterator[None]:
    """Let signals end the stream, and break off nothing that is being written.

    The second one ends us at once: the disk may be one that takes nothing any more.
    """

    def end(number: int, _: object) -> None:
        signal.signal(number, signal.SIG_DFL)
        # Whatever locks we hold just now.
        threading.Thread(target=stream.close, daemon=True).start()

    before = {}
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        found = signal.getsignal(number)
        if found is not signal.SIG_IGN:  # as by nohup
            before[number] = found
            signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            # Who has had enough does not wait for the rest either.
            if signal.getsignal(number) is end:
                signal.signal(number, handler)
