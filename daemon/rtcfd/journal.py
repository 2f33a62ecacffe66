"""Writes rtcfd's log: to the journal with fields, or to stderr as lines."""

import copy
import errno
import fcntl
import logging
import os
import queue
import socket
import sys
import threading
import time
from array import array
from collections.abc import Mapping

from rtcf_shared.printable import printable

ADDRESS = "/run/systemd/journal/socket"

# The size that libsystemd requests; the kernel grants at most net.core.wmem_max.
_SEND_BUFFER = 8 << 20
# The journal requires these seals of a file, which it reads in place.
_SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_WRITE | fcntl.F_SEAL_SEAL
_MOST_WAITING = 20_000  # records in the queue, so that a hanging journal does not fill the memory
_LAST_WORDS_S = 2.0  # longest wait for the queue at the end of rtcfd
_JOURNAL_PRIORITIES = (
    (logging.CRITICAL, 2),
    (logging.ERROR, 3),
    (logging.WARNING, 4),
    (logging.INFO, 6),
)
_DEBUG_PRIORITY = 7


class LogThread(logging.Handler):
    """Passes records on to another handler, in a thread; counts records that find no room.

    So a hanging journal blocks neither the event loop nor the watchdog.  Owned by the root logger.
    """

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
        failed = reported = 0
        while True:
            record = self._queue.get()
            try:
                failed += not self._written(record)
                lost = self._no_room + failed - reported
                if lost and self._queue.empty() and self._written(_report(lost)):
                    reported += lost
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


class JournalSocket:
    """Sends records by the journal's native protocol (systemd.io/JOURNAL_NATIVE_PROTOCOL).

    One datagram per record.  Owned and called by one thread.  Uses Python's socket, which releases
    the interpreter lock while it waits: a journal that does not read blocks only the thread that
    sends.  libsystemd's function would block all threads of rtcfd.
    """

    def __init__(self, address: str = ADDRESS) -> None:
        self._address = address
        # Not connected: a restarted journal may have a new socket.
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)

    def send(self, fields: Mapping[str, str]) -> None:
        """Send a record; waits until the journal has room for it.

        Raises OSError if there is no journal.
        """
        data = encoded(fields)
        try:
            self._socket.sendto(data, self._address)
        except OSError as error:
            if error.errno not in (errno.EMSGSIZE, errno.ENOBUFS):
                raise
            self._send_as_file(data)

    def _send_as_file(self, data: bytes) -> None:
        descriptor = os.memfd_create("rtcfd-log", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        with os.fdopen(descriptor, "wb", buffering=0) as file:
            rest = memoryview(data)
            while rest:
                rest = rest[file.write(rest) :]
            fcntl.fcntl(file, fcntl.F_ADD_SEALS, _SEALS)
            passed = (socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", [file.fileno()]))
            self._socket.sendmsg([], [passed], 0, self._address)


class JournalHandler(logging.Handler):
    """Sends records to systemd's journal.

    Fields: RTCF_RUNNER, RTCF_COMPONENT, RTCF_ITERATION, RTCF_USER, RTCF_UID, RTCF_PID,
    CODE_FILE, CODE_LINE, CODE_FUNC; the journal drops names that are not in capitals.
    """

    def __init__(self, address: str = ADDRESS) -> None:
        super().__init__()
        self._journal = JournalSocket(address)

    def emit(self, record: logging.LogRecord) -> None:
        """Send one record; waits until the journal has room for it.

        Raises OSError if there is no journal.
        """
        message = printable(standing_alone(record, self.format(record)), "\n\t")
        self._journal.send({"MESSAGE": message, **fields(record)})


class LineFormatter(logging.Formatter):
    """One readable line per record: time, level, runner, component, message, source."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        clock = time.strftime("%H:%M:%S", time.localtime(record.created))
        words = [f"{clock}.{int(record.msecs):03d}", f"{record.levelname:<7}"]
        component = getattr(record, "component", "")
        message = " ".join(record.getMessage().splitlines())
        words.append(printable(standing_alone(record, message), "\t"))
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


def encoded(fields: Mapping[str, str]) -> bytes:
    """Return a record in the journal's format."""
    return b"".join(_field(name, value) for name, value in fields.items())


def _field(name: str, value: str) -> bytes:
    # A file name may not be valid text; escaped, it stays readable, as on stderr.
    data = value.encode(errors="backslashreplace")
    if b"\n" not in data:
        return b"%s=%s\n" % (name.encode(), data)
    return b"%s\n%s%s\n" % (name.encode(), len(data).to_bytes(8, "little"), data)


def _report(lost: int) -> logging.LogRecord:
    text = f"{lost} log records were lost: the journal or terminal failed, or was too slow"
    return logging.LogRecord("rtcfd", logging.WARNING, "", 0, text, None, None)


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
    # gRPC logs a traceback for each metadata that is not UTF-8, which any client may send.
    logging.getLogger("grpc._cython.cygrpc").addFilter(
        lambda record: record.msg != "Invalid encoding on %s"
    )
