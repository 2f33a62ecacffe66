"""Nonsense on an executor's socket: it is hung up on, and the loop does not notice."""

import random
import socket
from pathlib import Path

import pytest
import rtcf
from daemon_process import Daemon, wait_for
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import runner_pb2

TIMES = [300, pytest.param(10_000, marks=pytest.mark.long)]


def frame(body: bytes) -> bytes:
    return len(body).to_bytes(4, "little") + body


def hello() -> bytes:
    return frame(wire.Request(id=1, hello=wire.Hello(protocol=1)).SerializeToString())


def nonsense(noise: random.Random) -> bytes:
    """Return bytes that are no request, in one of the ways in which that can be."""
    body = noise.randbytes(noise.randrange(1, 100))
    return noise.choice(
        [
            body,  # no frame
            frame(b"\x0f" + body),  # a frame, and no message
            (16 * 1024 * 1024 + 1 + noise.randrange(2**31)).to_bytes(4, "little"),  # too long
            frame(body)[:-1],  # ends before its end
            hello() + frame(b"\x0f" + body),
            frame(wire.Request(id=noise.getrandbits(64)).SerializeToString()),  # nothing asked
            hello() + frame(wire.Request(id=2, load=wire.Load(library="/etc/passwd"))
                            .SerializeToString()),
            # A change before hello.
            frame(wire.Request(id=1, stop=wire.Stop()).SerializeToString()),
        ]
    )  # fmt: skip


@pytest.mark.parametrize("times", TIMES)
def test_nonsense_changes_nothing(daemon: Daemon, client: rtcf.Client, times: int) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
    client.start()
    before = client.get_status().runners[0]
    path = Path(f"{daemon.socket}.d/executors/rt_runner.sock")
    noise = random.Random(times)
    for _ in range(times):
        with socket.socket(socket.AF_UNIX) as peer:
            peer.settimeout(60)
            peer.connect(str(path))
            try:
                peer.sendall(nonsense(noise))
                peer.shutdown(socket.SHUT_WR)
                while peer.recv(65536):
                    pass  # until it hangs up
            except ConnectionError:
                pass
    after = client.get_status().runners[0]
    assert (after.pid, after.realtime_tid) == (before.pid, before.realtime_tid)
    assert after.state == runner_pb2.RUNNER_STATE_RUNNING
    assert client.get_order() == ["/steady"]
    wait_for(lambda: client.get_status().runners[0].iteration > after.iteration, "cycles")
