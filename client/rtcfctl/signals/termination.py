"""Signal handling of commands that write a file until Ctrl-C."""

import contextlib
import signal
import threading
from collections.abc import Iterator

from rtcf.streams.ports import PortStream

from rtcfctl.terminal.interruption import kill_at_next


@contextlib.contextmanager
def ended_by_signals(stream: PortStream) -> Iterator[None]:
    """End the stream at SIGINT, SIGTERM or SIGHUP, so that the file is completed.

    The second signal kills the process at once, in case the disk hangs.
    """

    def end(number: int, _: object) -> None:
        # By a thread, because the interrupted code may hold locks of the stream.
        threading.Thread(target=stream.close, daemon=True).start()
        kill_at_next(number)

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
            # After the first signal, keep SIG_DFL: another signal ends the rest of the command.
            if signal.getsignal(number) is end:
                signal.signal(number, handler)
