"""Limits of clients: lengths, connections, calls, time; and hanging services."""

import asyncio
import logging
import socket
import threading
from pathlib import Path

import pytest
import rtcf
from daemon_process import wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2
from rtcf_shared.naming import suggestion
from rtcfd.access import calls, peer
from rtcfd.access.calls import Level
from rtcfd.access.clients import Usage
from rtcfd.access.peer import Credentials, Directory, Peer
from rtcfd.common.background import WorkerThreads
from rtcfd.common.errors import InvalidArgument, ResourceExhausted, Unavailable
from rtcfd.common.status_codes import bounded
from rtcfd.journal import LogThread
from strangers import STRANGER, open_to_strangers, root_only, stranger


def memory_kb(daemon: DaemonUnderTest) -> int:
    """Return rtcfd's peak memory."""
    assert daemon.process is not None
    lines = Path(f"/proc/{daemon.process.pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


def descriptors(daemon: DaemonUnderTest) -> int:
    """Return the number of rtcfd's open descriptors."""
    assert daemon.process is not None
    return len(list(Path(f"/proc/{daemon.process.pid}/fd").iterdir()))


def test_only_short_names_are_processed(daemon: DaemonUnderTest) -> None:
    with daemon.client() as client:
        client.get_status()
        before = memory_kb(daemon)
        for length, said in (
            (4000, "component of 4000 characters is too long: at most 255"),
            (300_000, "too large for GetComponent: at most 16384"),
            (15_000_000, "too large for GetComponent: at most 16384"),
        ):
            with pytest.raises(rtcf.RefusedError, match=said) as refused:
                client.get_component("x" * length)
            assert refused.value.code in ("INVALID_ARGUMENT", "RESOURCE_EXHAUSTED")
        assert memory_kb(daemon) - before < 120_000


def test_texts_have_their_own_limits() -> None:
    spec = rtcf.component("pkg", "T", name="n", remaps=["a:=" + "b" * 1000])
    calls.check_texts(control_pb2.LoadRequest(component=spec))
    for field in ("name", "ns", "package", "type"):
        long = control_pb2.LoadRequest(component=spec)
        setattr(long.component, field, "ä" * 256)
        with pytest.raises(InvalidArgument, match=f"{field} of 256 characters is too long"):
            calls.check_texts(long)
    value = control_pb2.WritePortRequest(component="n", port="in", value="1" * 1_000_000)
    calls.check_texts(value)
    value.port = "p" * 256
    with pytest.raises(InvalidArgument, match="port of 256 characters is too long"):
        calls.check_texts(value)
    names = control_pb2.UnloadRequest(components=["short", "x" * 256])
    with pytest.raises(InvalidArgument, match="components of 256 characters"):
        calls.check_texts(names)


def test_an_error_fits_into_metadata_and_keeps_its_advice() -> None:
    assert bounded("  short\n one ") == "short one"
    text = bounded("no component " + "ä€😀" * 5000 + ": list them")
    assert len(text.encode()) < 4000
    assert text.startswith("no component")
    assert text.endswith(": list them")
    assert suggestion("x" * 1_000_000, ["y" * 1_000_000]) == ""


def test_an_observer_has_limited_calls_and_streams() -> None:
    ann = Peer(1, 1, "ann", frozenset())
    usage = Usage()
    watches = [usage.calling("WatchStatistics", ann, Level.OBSERVE) for _ in range(8)]
    for each in watches:
        each.__enter__()
    with (
        pytest.raises(ResourceExhausted, match="user ann has 8 open streams, the limit of a user"),
        usage.calling("WatchStatistics", ann, Level.OBSERVE),
    ):
        pass
    with usage.calling("WatchStatistics", ann, Level.OPERATE):
        pass  # users with the right operate are not limited
    for each in watches:
        each.__exit__(None, None, None)
    with usage.calling("WatchStatistics", ann, Level.OBSERVE):
        pass


IDLE = """
import socket, sys
peers = []
for _ in range(int(sys.argv[2])):
    peer = socket.socket(socket.AF_UNIX)
    peer.setblocking(False)
    try:
        peer.connect(sys.argv[1])
    except BlockingIOError:
        pass
    peers.append(peer)
print("there", flush=True)
sys.stdin.read()
"""


@root_only
def test_a_user_without_rights_leaves_room_for_others() -> None:
    rules = "[access]\ndefault = 'none'\n[limits]\nclients = 16\n"
    with (
        open_to_strangers(rules) as daemon,
        stranger(IDLE, str(daemon.socket), "600") as idle,
    ):
        assert idle.stdout is not None
        assert idle.stdout.readline() == "there\n"
        with daemon.client() as client:
            client.get_status()
            client.start()
            client.stop()
        assert descriptors(daemon) < 200
        idle.kill()
        wait_for(lambda: descriptors(daemon) < 60, "the end of all connections")


def test_half_closed_clients_that_read_nothing_leave_no_descriptor(
    daemon: DaemonUnderTest,
) -> None:
    with daemon.client() as client:
        client.get_status()
    before = descriptors(daemon)
    preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
    ping = bytes([0, 0, 8, 6, 0, 0, 0, 0, 0]) + b"12345678"
    peers = []
    for _ in range(40):
        client_socket = socket.socket(socket.AF_UNIX)
        client_socket.connect(str(daemon.socket))
        client_socket.sendall(preface + ping * 200)
        client_socket.shutdown(socket.SHUT_WR)
        peers.append(client_socket)
    wait_for(lambda: descriptors(daemon) <= before + 3, "the end of half-closed connections")
    for each in peers:
        each.close()


def test_a_hanging_user_database_affects_only_users_whose_names_are_needed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gate = threading.Event()

    def hangs(_: Credentials) -> tuple[str, frozenset[str]]:
        gate.wait(60)
        return "late", frozenset()

    async def work() -> None:
        monkeypatch.setattr(peer, "_names", hangs)
        monkeypatch.setattr(peer, "_TIMEOUT_S", 0.05)
        directory = Directory()
        found = await directory.peer(Credentials(1, STRANGER, frozenset({1})))
        assert (found.user, found.known) == (f"#{STRANGER}", False)
        root = directory.known(Credentials(1, 0, frozenset()))
        assert root is not None
        assert root.known

    asyncio.run(work())
    gate.set()


def test_hanging_work_times_out_and_keeps_its_thread() -> None:
    gate = threading.Event()

    async def work() -> None:
        threads = WorkerThreads("museum", threads=1)
        assert await threads.run(lambda: 7, 60) == 7
        with pytest.raises(Unavailable, match="no answer from the museum within 0.05 s"):
            await threads.run(lambda: gate.wait(60), 0.05)
        with pytest.raises(Unavailable):
            await threads.run(lambda: 7, 0.05)  # its only thread still hangs
        gate.set()
        assert await threads.run(lambda: 8, 60) == 8
        with pytest.raises(ZeroDivisionError):
            await threads.run(lambda: 1 // 0, 60)

    asyncio.run(work())


def test_a_hanging_journal_blocks_nobody_and_dropped_records_are_counted() -> None:
    gate = threading.Event()
    written: list[str] = []

    class Hanging(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            gate.wait(60)
            written.append(record.getMessage())

    handler = LogThread(Hanging(), most=10)
    logger = logging.Logger("test")
    logger.addHandler(handler)
    for number in range(100):
        logger.info("record %d", number)  # returns, although nothing is written
    assert not written
    gate.set()
    wait_for(lambda: written and "were lost" in written[-1], "the count")
    assert written[0] == "record 0"
    lost = int(written[-1].split()[0])
    assert lost + len(written) - 1 == 100
