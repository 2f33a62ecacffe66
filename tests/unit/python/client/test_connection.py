"""A connection that ends in an unusual way."""

import threading
from pathlib import Path

import pytest
from rtcf.connection import Connection
from rtcf.v1 import ports_pb2


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
