"""Writes rtcfd's log: to the journal with fields, or to stderr as lines."""

import logging
import os
import sys
import time

from rtcfd import journal_socket
from rtcfd.log_thread import LogThread

_JOURNAL_PRIORITIES = (
    (logging.CRITICAL, 2),
    (logging.ERROR, 3),
    (logging.WARNING, 4),
    (logging.INFO, 6),
)
_DEBUG_PRIORITY = 7


class JournalHandler(logging.Handler):
    """Sends records to systemd's journal.

    Fields: RTCF_RUNNER, RTCF_COMPONENT, RTCF_ITERATION, RTCF_USER, RTCF_UID, RTCF_PID,
    CODE_FILE, CODE_LINE, CODE_FUNC; the journal drops names that are not in capitals.
    """

    def __init__(self, address: str = journal_socket.ADDRESS) -> None:
        super().__init__()
        self._journal = journal_socket.JournalSocket(address)

    def emit(self, record: logging.LogRecord) -> None:
        """Send one record; waits until the journal has room for it.

        Raises OSError if there is no journal.
        """
        message = standing_alone(record, self.format(record))
        self._journal.send({"MESSAGE": message, **fields(record)})


class LineFormatter(logging.Formatter):
    """One readable line per record: time, level, runner, component, message, source."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        clock = time.strftime("%H:%M:%S", time.localtime(record.created))
        words = [f"{clock}.{int(record.msecs):03d}", f"{record.levelname:<7}"]
        component = getattr(record, "component", "")
        words.append(standing_alone(record, " ".join(record.getMessage().splitlines())))
        if component and record.pathname:
            iteration = getattr(record, "iteration", 0)
            words.append(f"({os.path.basename(record.pathname)}:{record.lineno}, #{iteration})")
        line = " ".join(words)
        if record.exc_info:
            line += "\n" + self.formatException(record.exc_info)
        return line


def standing_alone(record: logging.LogRecord, message: str) -> str:
    """Return a message with its runner and component, for readers without the journal's fields."""
    runner = getattr(record, "runner", "")
    component = getattr(record, "component", "")
    if component and not message.startswith(f"{component}:"):
        message = f"{component}: {message}"
    if runner and not message.startswith((f"{runner}:", f"runner {runner}:")):
        message = f"{runner}{' ' if component else ': '}{message}"
    return message


def fields(record: logging.LogRecord) -> dict[str, str]:
    """Return the journal's fields of a record, except for its message."""
    priority = next(
        (value for level, value in _JOURNAL_PRIORITIES if record.levelno >= level), _DEBUG_PRIORITY
    )
    result = {"PRIORITY": str(priority), "SYSLOG_IDENTIFIER": "rtcfd"}
    if record.pathname:
        result["CODE_FILE"] = record.pathname
        result["CODE_LINE"] = str(record.lineno)
    if record.funcName:
        result["CODE_FUNC"] = record.funcName
    if runner := getattr(record, "runner", ""):
        result["RTCF_RUNNER"] = runner
    peer = getattr(record, "peer", None)
    if peer is not None:
        result["RTCF_USER"] = peer.user
        result["RTCF_UID"] = str(peer.uid)
        result["RTCF_PID"] = str(peer.pid)
    if component := getattr(record, "component", ""):
        result["RTCF_COMPONENT"] = component
        result["RTCF_ITERATION"] = str(getattr(record, "iteration", 0))
    return result


def stderr_is_journal() -> bool:
    """Return whether stderr is connected to the journal (systemd.exec(5), $JOURNAL_STREAM)."""
    device, _, inode = os.environ.get("JOURNAL_STREAM", "").partition(":")
    if not (device.isdigit() and inode.isdigit()):
        return False
    found = os.fstat(2)
    return (found.st_dev, found.st_ino) == (int(device), int(inode))


def set_up(verbose: bool) -> None:
    """Install the handler of all log records: the journal if stderr is connected to it."""
    handler: logging.Handler
    if stderr_is_journal():
        handler = JournalHandler()
    else:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(LineFormatter())
    root = logging.getLogger()
    root.handlers[:] = [LogThread(handler)]
    root.setLevel(logging.DEBUG if verbose else logging.INFO)
    logging.getLogger("asyncio").setLevel(logging.WARNING)
