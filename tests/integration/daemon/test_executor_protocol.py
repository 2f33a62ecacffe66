"""Invalid bytes on an executor's socket: it closes the connection, and the loop is unaffected."""

import random
import re
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, wait_for
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import runner_pb2

MIB = 1024 * 1024
STOPPED = runner_pb2.RUNNER_STATE_STOPPED
TIMES = [300, pytest.param(10_000, marks=pytest.mark.long)]


def frame(body: bytes) -> bytes:
    return len(body).to_bytes(4, "little") + body


def hello() -> bytes:
    return frame(wire.Request(id=1, hello=wire.Hello(protocol=1)).SerializeToString())


def nonsense(noise: random.Random) -> bytes:
    """Return bytes that are not a valid request, in one of several ways."""
    body = noise.randbytes(noise.randrange(1, 100))
    return noise.choice(
        [
            body,  # without framing
            frame(b"\x0f" + body),  # framed, but not a message
            (16 * 1024 * 1024 + 1 + noise.randrange(2**31)).to_bytes(4, "little"),  # too long
            frame(body)[:-1],  # truncated
            hello() + frame(b"\x0f" + body),
            frame(wire.Request(id=noise.getrandbits(64)).SerializeToString()),  # an empty request
            hello() + frame(wire.Request(id=2, load=wire.Load(library="/etc/passwd"))
                            .SerializeToString()),
            # A change before the hello.
            frame(wire.Request(id=1, stop=wire.Stop()).SerializeToString()),
        ]
    )  # fmt: skip


@pytest.mark.parametrize("times", TIMES)
def test_invalid_bytes_change_nothing(daemon: Daemon, client: rtcf.Client, times: int) -> None:
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
                    pass  # until it closes the connection
            except ConnectionError:
                pass
    after = client.get_status().runners[0]
    assert (after.pid, after.realtime_tid) == (before.pid, before.realtime_tid)
    assert after.state == runner_pb2.RUNNER_STATE_RUNNING
    assert client.get_order() == ["/steady"]
    wait_for(lambda: client.get_status().runners[0].iteration > after.iteration, "cycles")


def _messages(peer: socket.socket) -> Iterator[wire.Response]:
    """Yield messages up to the next answer, which is the last."""
    while True:
        size = int.from_bytes(_read(peer, 4), "little")
        response: wire.Response = wire.Response.FromString(_read(peer, size))
        yield response
        if response.id:
            return


def _answer(peer: socket.socket) -> wire.Response:
    """Read the next answer; skip unsolicited messages."""
    return list(_messages(peer))[-1]


def _read(peer: socket.socket, size: int) -> bytes:
    read = bytearray()
    while len(read) < size:
        got = peer.recv(size - len(read))
        assert got, "the connection was closed"
        read += got
    return bytes(read)


def _resident_bytes(pid: int) -> int:
    found = re.search(r"^VmRSS:\s+(\d+) kB$", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
    assert found
    return int(found[1]) * 1024


def test_a_slow_peer_costs_only_its_unread_answers(daemon: Daemon, client: rtcf.Client) -> None:
    for number in range(50):
        client.load(rtcf.component("rtcf_test", "Counter", name=f"c{number}"))
    pid = client.get_status().runners[0].pid
    with socket.socket(socket.AF_UNIX) as peer:
        peer.settimeout(60)
        peer.connect(f"{daemon.socket}.d/executors/rt_runner.sock")
        peer.sendall(hello())
        _answer(peer)
        ask = frame(wire.Request(id=2, list_components=wire.ListComponents()).SerializeToString())
        peer.sendall(ask)
        size = _answer(peer).ByteSize()
        # More than the socket's buffer holds.
        peer.sendall(ask * (4 * MIB // size))
        before = _resident_bytes(pid)
        for _ in range(128 * MIB // size):
            assert _answer(peer).id == 2
            peer.sendall(ask)
        assert _resident_bytes(pid) - before < 64 * MIB


def test_no_answer_shows_a_direct_stop_before_it_is_told(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
    ask = frame(wire.Request(id=2, get_status=wire.GetStatus()).SerializeToString())
    with socket.socket(socket.AF_UNIX) as peer:
        peer.settimeout(60)
        peer.connect(f"{daemon.socket}.d/executors/rt_runner.sock")
        peer.sendall(hello())
        _answer(peer)
        for count in range(1, 101):
            client.start()
            with socket.socket(socket.AF_UNIX) as stopping:
                stopping.connect(f"{daemon.socket}.d/stop/rt_runner")
                stopping.sendall(b"stop\n")
                told = 0
                stopped = False
                while not stopped:
                    peer.sendall(ask)
                    for response in _messages(peer):
                        if response.HasField("direct_stop"):
                            told = response.direct_stop.count
                        elif response.HasField("status"):
                            stopped = response.status.state == runner_pb2.RUNNER_STATE_STOPPED
                assert told == count
            wait_for(lambda: client.get_status().runners[0].state == STOPPED, "the stop at rtcfd")


def _unknown() -> Any:
    """Return a value of no enumeration; its type allows it in place of any of them."""
    return 99


def test_unknown_enumerators_are_rejected(daemon: Daemon, client: rtcf.Client) -> None:
    requests = [
        wire.Request(id=2, configure=runner_pb2.RunnerSettings(realtime=_unknown())),
        wire.Request(
            id=2, configure=runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(peers=_unknown()))
        ),
        wire.Request(
            id=2,
            access=wire.AccessRules(users=[wire.AccessRules.Entry(id=1, right=_unknown())]),
        ),
    ]
    before = client.get_status().runners[0].settings
    for request in requests:
        with socket.socket(socket.AF_UNIX) as peer:
            peer.settimeout(60)
            peer.connect(f"{daemon.socket}.d/executors/rt_runner.sock")
            peer.sendall(hello())
            _answer(peer)
            peer.sendall(frame(request.SerializeToString()))
            error = _answer(peer).error
            assert error.code == wire.Error.CODE_INVALID_ARGUMENT
            assert " 99 is not known: choose of " in error.message
    assert client.get_status().runners[0].settings == before
    checked = subprocess.run(
        [BUILD_TREE / "bin" / "rtcf-executor", "--check-settings"],
        input=runner_pb2.RunnerSettings(on_crash=_unknown()).SerializeToString(),
        capture_output=True,
        check=False,
    )
    assert checked.returncode == 1
    assert b"on_crash 99 is not known: choose of " in checked.stderr
