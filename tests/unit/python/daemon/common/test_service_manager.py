"""Notifications to systemd, and detection of its journal."""

import logging
import os
import socket
import threading
from pathlib import Path

import pytest
from daemon_process import wait_for
from daemon_under_test import DaemonUnderTest
from rtcfd import journal


def test_ready_status_and_watchdog_are_sent(
    stopped_daemon: DaemonUnderTest, tmp_path: Path
) -> None:
    told: list[bytes] = []

    # In a thread: a sender blocks once ten messages are unread.
    def listen() -> None:
        while message := manager.recv(4096):
            told.extend(message.splitlines())

    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        listening = threading.Thread(target=listen)
        listening.start()
        stopped_daemon.environment = {
            "NOTIFY_SOCKET": str(tmp_path / "notify"),
            "WATCHDOG_USEC": "100000",
        }
        try:
            stopped_daemon.start()
            wait_for(lambda: told.count(b"WATCHDOG=1") > 1, "the watchdog to be fed")
            assert b"READY=1" in told
            assert b"STATUS=rt_runner stopped" in told
            stopped_daemon.end()
        finally:
            manager.sendto(b"", manager.getsockname())
            listening.join()
    assert b"STOPPING=1" in told


def test_journal_fields_are_in_capitals() -> None:
    record = logging.getLogger("x").makeRecord(
        "x", logging.WARNING, "/src/a.cpp", 12, "%s", ("m",), None, "update",
        {"runner": "rt_runner", "component": "/H1", "iteration": 7},
    )  # fmt: skip
    assert journal.fields(record) == {
        "PRIORITY": "4",
        "SYSLOG_IDENTIFIER": "rtcfd",
        "CODE_FILE": "/src/a.cpp",
        "CODE_LINE": "12",
        "CODE_FUNC": "update",
        "RTCF_RUNNER": "rt_runner",
        "RTCF_COMPONENT": "/H1",
        "RTCF_ITERATION": "7",
    }


def test_the_journal_is_detected_by_its_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    found = os.fstat(2)
    monkeypatch.setenv("JOURNAL_STREAM", f"{found.st_dev}:{found.st_ino}")
    assert journal.stderr_is_journal()
    monkeypatch.setenv("JOURNAL_STREAM", f"{found.st_dev}:{found.st_ino + 1}")
    assert not journal.stderr_is_journal()
    monkeypatch.delenv("JOURNAL_STREAM")
    assert not journal.stderr_is_journal()
