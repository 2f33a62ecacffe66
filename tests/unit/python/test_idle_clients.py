"""Connections that nobody uses end: those that never made a call, and those that made none for
long; a call that lasts is no idleness.  Who is hung up on is let read to the end."""

import asyncio
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from daemon_under_test import DEADLINE_S
from rtcfd.access import clients
from rtcfd.access.calls import Level
from rtcfd.access.clients import Clients, Doors
from rtcfd.common.limits import Limits


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients, "_LOOK_S", 0.02)


class Front:
    """Clients in front of a server that hangs up on who talks to it, with some last words."""

    def __init__(self, folder: Path, level: Level, last_words: bytes) -> None:
        self._folder = folder
        self._last_words = last_words
        self.clients = Clients(
            Doors(folder / "trusted", folder / "others"), Limits(), lambda _: level
        )
        self.shown: list[str] = []  # of each connection, as gRPC shows it
        self._writers: list[asyncio.StreamWriter] = []  # Python 3.13 hangs up when they go

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
        """What the newest client writes by."""
        return self._writers[-1]

    async def connect(self) -> asyncio.StreamReader:
        """Return what a new client reads; it is kept as long as the front is."""
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


def test_a_connection_that_makes_no_more_calls_ends_and_not_before_its_last_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clients, "_FIRST_CALL_S", 3600.0)
    monkeypatch.setattr(clients, "_IDLE_S", 0.05)

    async def work(front: Front) -> None:
        lasting = await front.connect()
        with front.clients.calling(front.shown[0], "WatchStatistics"):
            # One that came later, and was used, has been hung up on while this one was not.
            idle = await front.connect()
            with front.clients.calling(front.shown[1], "GetStatus"):
                pass
            assert await idle.read() == b""
            assert not lasting.at_eof()
        assert await lasting.read() == b""

    with_front(tmp_path, work)


def test_who_was_hung_up_on_may_still_talk_until_it_has_read_all(
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


def test_what_was_answered_is_handed_on_though_its_reader_still_talks(
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


def test_who_was_hung_up_on_and_talks_on_holds_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clients, "_LINGER_S", 0.01)

    class Talker(socket.socket):
        """One that always has something more to say, as seen by who listens."""

        words = 0

        def recv(self, size: int, flags: int = 0) -> bytes:
            self.words += 1
            assert self.words < 1_000_000, "nothing else has its turn"
            return b"x"

    ours, theirs = socket.socketpair()
    with theirs, Talker(fileno=ours.detach()) as talker:
        talker.setblocking(False)
        asyncio.run(clients._linger(talker))
        assert talker.words
