"""Records sent to the journal, and a journal that does not read."""

import fcntl
import logging
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from daemon_process import DEADLINE_S, wait_for
from rtcfd.journal import JournalHandler, LogThread

# A process that logs more than the journal's socket holds.
_LOGGING = """
import logging, sys
sys.path[:] = {path!r}
from rtcfd.journal import JournalHandler, LogThread
logging.getLogger().addHandler(LogThread(JournalHandler({address!r})))
for number in range(2000):
    logging.getLogger().warning("record %d", number)
print("all logged", flush=True)
"""


class Journal:
    """A socket like the journal's, which reads on demand."""

    def __init__(self, address: Path) -> None:
        self.address = str(address)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(self.address)
        self._socket.settimeout(DEADLINE_S)

    def close(self) -> None:
        self._socket.close()

    def read(self) -> dict[str, str]:
        """Return the fields of the next record."""
        data, descriptors, _, _ = socket.recv_fds(self._socket, 1 << 20, 1)
        if descriptors:
            assert not data
            with os.fdopen(descriptors[0], "rb") as file:
                seals = fcntl.fcntl(file, fcntl.F_GET_SEALS)
                # Without these seals the journal rejects it.
                assert seals & fcntl.F_SEAL_WRITE
                assert seals & fcntl.F_SEAL_SHRINK
                file.seek(0)
                data = file.read()
        found = {}
        while data:
            line, _, data = data.partition(b"\n")
            name, equals, value = line.partition(b"=")
            if not equals:
                length = int.from_bytes(data[:8], "little")
                value, end, data = data[8 : 8 + length], data[8 + length], data[9 + length :]
                assert end == ord("\n")
            found[name.decode()] = value.decode()
        return found


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    journal = Journal(tmp_path / "journal")
    yield journal
    journal.close()


@pytest.fixture
def logger(journal: Journal) -> logging.Logger:
    logger = logging.Logger("test")
    logger.addHandler(LogThread(JournalHandler(journal.address), most=10))
    return logger


def test_a_record_comes_with_its_fields(journal: Journal, logger: logging.Logger) -> None:
    logger.warning("is late", extra={"runner": "arm", "component": "/H1", "iteration": 7})
    found = journal.read()
    assert found.pop("CODE_FILE") == __file__
    assert found.pop("CODE_FUNC") == "test_a_record_comes_with_its_fields"
    assert found.pop("CODE_LINE").isdigit()
    assert found == {
        "MESSAGE": "arm /H1: is late",
        "PRIORITY": "4",
        "SYSLOG_IDENTIFIER": "rtcfd",
        "RTCF_RUNNER": "arm",
        "RTCF_COMPONENT": "/H1",
        "RTCF_ITERATION": "7",
    }


@pytest.mark.parametrize("message", ["a = b\nPRIORITY=0\n", "=", "", "ä\n", "\n"])
def test_a_message_with_any_content_stays_one_field(
    journal: Journal, logger: logging.Logger, message: str
) -> None:
    logger.info("%s", message)
    found = journal.read()
    assert (found["MESSAGE"], found["PRIORITY"]) == (message, "6")


def test_invalid_text_stays_readable(journal: Journal, logger: logging.Logger) -> None:
    logger.info("cannot read %s", os.fsdecode(b"/home/\xff"))
    assert journal.read()["MESSAGE"] == "cannot read /home/\\udcff"


def test_a_record_larger_than_a_datagram_is_sent_as_a_file(
    journal: Journal, logger: logging.Logger
) -> None:
    long = "\n".join(f"line {number}" for number in range(2_000_000))
    logger.error("%s", long)
    found = journal.read()
    assert found["MESSAGE"] == long
    assert found["PRIORITY"] == "3"
    logger.info("small")
    assert journal.read()["MESSAGE"] == "small"


def test_a_journal_that_does_not_read_blocks_nobody(
    journal: Journal, logger: logging.Logger
) -> None:
    for number in range(2000):
        logger.info("record %d", number)  # returns, although nothing is read
    taken, lost = 0, 0
    while taken + lost < 2000:
        message = journal.read()["MESSAGE"]
        if "were lost" in message:
            lost += int(message.split()[0])
        else:
            taken += 1
    assert taken + lost == 2000
    assert lost


def test_a_process_can_end_without_a_reading_journal(journal: Journal) -> None:
    script = _LOGGING.format(path=sys.path, address=journal.address)
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True, text=True, timeout=DEADLINE_S, check=False,
    )  # fmt: skip
    assert (done.stdout, done.stderr, done.returncode) == ("all logged\n", "", 0)


def test_a_recovered_journal_gets_the_count_of_dropped_records(
    journal: Journal, logger: logging.Logger
) -> None:
    logger.info("first")
    assert journal.read()["MESSAGE"] == "first"
    journal.close()
    os.unlink(journal.address)
    logger.info("into nothing")
    (handler,) = logger.handlers
    assert isinstance(handler, LogThread)
    waiting = handler._queue
    wait_for(lambda: not waiting.unfinished_tasks, "the record to be dropped")
    again = Journal(Path(journal.address))
    logger.info("second")
    assert again.read()["MESSAGE"] == "second"
    assert again.read()["MESSAGE"].startswith("1 log records were lost")
    again.close()
