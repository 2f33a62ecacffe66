"""A connection that ends in an unusual way."""

import os
import socket
import threading
from pathlib import Path

import pytest
from rtcf import DaemonUnreachableError, connection
from rtcf.connection import Connection
from rtcf.v1 import control_pb2, ports_pb2

_STRANGER = 54321  # an unused uid


def test_closing_does_not_wait_for_a_call_whose_start_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    # Ctrl-C after gRPC has begun a call, before the thread that completes it.
    monkeypatch.setattr("grpc._channel._run_channel_spin_thread", interrupt)
    connection = Connection(tmp_path / "none")
    with pytest.raises(KeyboardInterrupt):
        list(connection.stream(connection.stub.WatchPorts, ports_pb2.WatchPortsRequest()))
    closing = threading.Thread(target=connection.close, daemon=True)
    closing.start()
    closing.join(60.0)
    assert not closing.is_alive()


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to act as another user")
@pytest.mark.parametrize("queue_is_full", [False, True])
def test_a_silent_socket_of_another_user_is_reported_soon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, queue_is_full: bool
) -> None:
    monkeypatch.setattr(connection, "_CONNECT_TO_STRANGER_MS", 200)
    monkeypatch.setattr(connection, "_CROWDED_S", 0.2)
    path = str(tmp_path / "theirs")
    with socket.socket(socket.AF_UNIX) as theirs, socket.socket(socket.AF_UNIX) as waiting:
        theirs.bind(path)
        theirs.listen(0 if queue_is_full else 100)
        if queue_is_full:
            waiting.connect(path)
        os.chown(path, _STRANGER, _STRANGER)
        with Connection(path) as ours:
            with pytest.raises(DaemonUnreachableError) as asked:
                ours.ask(ours.stub.GetStatus, control_pb2.GetStatusRequest(), None)
            with pytest.raises(DaemonUnreachableError) as streamed:
                list(ours.stream(ours.stub.WatchPorts, ports_pb2.WatchPortsRequest()))
        for each in (asked, streamed):
            assert str(each.value) == (
                f"rtcfd at {path} does not answer in time: its socket belongs to uid "
                f"{_STRANGER}; name another one with --socket or RTCF_SOCKET"
            )
