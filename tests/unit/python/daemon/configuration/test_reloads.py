"""Concurrent reloads of the settings."""

from pathlib import Path

import grpc
import pytest
from daemon_process import DEADLINE_S, wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2, control_pb2_grpc


@pytest.fixture
def judged(stopped_daemon: DaemonUnderTest) -> Path:
    """A file with a line for each start and end of a settings check by the executor; a check does
    not end while a file `held` exists next to it."""
    notes = stopped_daemon.folder / "judged"
    notes.touch()
    held = stopped_daemon.folder / "held"
    peer = stopped_daemon.executor.read_text().partition("\n")[2]
    stopped_daemon.executor.write_text(
        "#!/bin/sh\n"
        f'if [ "$1" = --check-settings ]; then echo begin >> {notes}\n'
        f"while [ -e {held} ]; do sleep 0.1; done\n"
        # A concurrent check would start during this time.
        f"sleep 0.5; echo end >> {notes}; fi\n" + peer
    )
    return notes


def test_concurrent_reloads_are_serialised(stopped_daemon: DaemonUnderTest, judged: Path) -> None:
    daemon = stopped_daemon.start_service()
    held = judged.with_name("held")
    held.touch()
    judged.write_text("")
    calls = []
    with grpc.insecure_channel(f"unix:{daemon.socket}") as channel:
        stub = control_pb2_grpc.ControlStub(channel)  # type: ignore[no-untyped-call]
        for frequency in (300, 400, 500):
            # Each is requested while the first one runs.
            daemon.settings.write_text(f"[runner]\nfrequency_hz = {frequency}.0\n")
            call = stub.Reload(control_pb2.ReloadRequest(), timeout=DEADLINE_S)
            assert next(call).progress
            wait_for(judged.read_text, "the first reload")
            calls.append(call)
        assert judged.read_text() == "begin\n"
        held.unlink()
        results = [list(call)[-1].result for call in calls]
    assert judged.read_text() == "begin\nend\n" * 3
    # Each starts from the result of the previous one: the third reads the same as the second.
    changed = ["defaults of runners changed" in result.notes for result in results]
    assert changed == [True, True, False]
    with daemon.client() as client:
        assert client.get_status().runners[0].settings.frequency_hz == 500.0
