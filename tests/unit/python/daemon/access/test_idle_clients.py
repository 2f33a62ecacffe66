"""Idle connections end: those without any call, and those without a call for a long time. A
lasting call is not idle. The peer of a closed connection can read the rest of the data."""

import asyncio
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from daemon_process import DEADLINE_S
from rtcfd.access import clients
from rtcfd.access.calls import Level
from rtcfd.access.clients import Clients, GrpcSockets
from rtcfd.common.limits import Limits


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients, "_LOOK_S", 0.02)


class Front:
    """Clients in front of a server that answers each client with some last words and closes."""

    def __init__(self, folder: Path, level: Level, last_words: bytes) -> None:
        self._folder = folder
        self._last_words = last_words
        self.clients = Clients(
            GrpcSockets(folder / "trusted", folder / "others"), Limits(), lambda _: level
        )
        self.shown: list[str] = []  # per connection, as gRPC sees it
        self._writers: list[asyncio.StreamWriter] = []  # Python 3.13 closes lost writers

    async def serve(self) -> None:
        async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            name = writer.get_extra_info("socket").getpeername()
            self.shown.append("unix-abstract:" + name[1:].decode())
            if await reader.read(1):
                writer.write(self._last_words)
            writer.close()

        for door in ("trusted", "others"):
            await asyncio.start_unix_server(answer, self._folder / door)
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(self._folder / "s"))
        listener.listen()
        await self.clients.serve(listener)

    @property
    def writer(self) -> asyncio.StreamWriter:
        """The writer to the newest client."""
        return self._writers[-1]

    async def connect(self) -> asyncio.StreamReader:
        """Return the reader of a new client, which lasts as long as the front."""
        number = len(self.shown)
        reader, writer = await asyncio.open_unix_connection(self._folder / "s")
        self._writers.append(writer)
        while len(self.shown) == number:
            await asyncio.sleep(0.001)
        return reader


def with_front(
    folder: Path,
    work: Callable[[Front], Awaitable[None]],
    level: Level = Level.OBSERVE,
    last_words: bytes = b"",
) -> None:
    async def run() -> None:
        front = Front(folder, level, last_words)
        await front.serve()
        try:
            async with asyncio.timeout(DEADLINE_S):
                await work(front)
        finally:
            front.clients.close()

    asyncio.run(run())


@pytest.mark.parametrize("level", [Level.NONE, Level.OBSERVE, Level.ADMIN])
def test_a_connection_that_makes_no_call_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, level: Level
) -> None:
    monkeypatch.setattr(clients, "_FIRST_CALL_S", 0.05)

    async def work(front: Front) -> None:
        assert await (await front.connect()).read() == b""

    with_front(tmp_path, work, level)


def test_an_idle_connection_ends_after_its_last_call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clients, "_FIRST_CALL_S", 3600.0)
    monkeypatch.setattr(clients, "_IDLE_S", 0.05)

    async def work(front: Front) -> None:
        lasting = await front.connect()
        with front.clients.calling(front.shown[0], "WatchStatistics"):
            # A later connection, already used, was closed before this one.
            idle = await front.connect()
            with front.clients.calling(front.shown[1], "GetStatus"):
                pass
            assert await idle.read() == b""
            assert not lasting.at_eof()
        assert await lasting.read() == b""

    with_front(tmp_path, work)


def test_a_closed_connections_peer_may_write_until_it_has_read_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clients, "_LINGER_S", DEADLINE_S)

    async def work(front: Front) -> None:
        reader = await front.connect()
        front.writer.write(b"?")
        assert await reader.read() == b""
        for _ in range(3):
            front.writer.write(b"?")
            await front.writer.drain()
        front.writer.close()

    with_front(tmp_path, work)


def test_an_answer_is_delivered_although_its_reader_still_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    last_words = b"x" * 1000
    monkeypatch.setattr(clients, "_CHUNK", 1)
    monkeypatch.setattr(clients, "_LINGER_S", DEADLINE_S)

    async def work(front: Front) -> None:
        loop = asyncio.get_running_loop()
        send = loop.sock_sendall

        async def send_slowly(to: socket.socket, data: bytes) -> None:
            await asyncio.sleep(0)
            await send(to, data)

        monkeypatch.setattr(loop, "sock_sendall", send_slowly)
        reader = await front.connect()
        front.writer.write(b"?")
        await reader.readexactly(10)
        front.writer.write(b"?" * 10)
        assert await reader.read() == last_words[10:]
        front.writer.close()

    with_front(tmp_path, work, last_words=last_words)


def test_a_closed_connections_peer_that_keeps_writing_blocks_nobody(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(clients, "_LINGER_S", 0.01)

    class Talker(socket.socket):
        """A socket whose peer always has more data."""

        words = 0

        def recv(self, size: int, flags: int = 0) -> bytes:
            self.words += 1
            assert self.words < 1_000_000, "the event loop is starved"
            return b"x"

    ours, theirs = socket.socketpair()
    with theirs, Talker(fileno=ours.detach()) as talker:
        talker.setblocking(False)
        asyncio.run(clients._linger(talker))
        assert talker.words
