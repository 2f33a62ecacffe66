"""The link to an executor: concurrent requests, limits, a misbehaving peer."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from daemon_process import DEADLINE_S
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import errors_pb2
from rtcfd.common import errors
from rtcfd.executor.link import MAX_MESSAGE, PROTOCOL, Link, pack_message, read_message

Peer = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]

STATUS = wire.GetStatus()


def against(tmp_path: Path, peer: Peer, test: Callable[[Link], Awaitable[None]]) -> None:
    """Run a test with a link to a peer."""

    async def run() -> None:
        path = tmp_path / "s"
        server = await asyncio.start_unix_server(peer, path)
        link = await Link.connect("the peer", path, lambda _: None)
        try:
            await test(link)
        finally:
            await link.close()
            server.close()

    asyncio.run(run())


async def received(reader: asyncio.StreamReader) -> wire.Request:
    message = await read_message(reader)
    assert message is not None
    request = wire.Request()
    request.ParseFromString(message)
    return request


def test_answers_are_matched_to_requests_in_any_order(tmp_path: Path) -> None:
    async def peer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        requests = [await received(reader) for _ in range(3)]
        for request in reversed(requests):
            response = wire.Response(id=request.id)
            response.component.full_name = request.get_component.component
            writer.write(pack_message(response.SerializeToString()))

    async def test(link: Link) -> None:
        async def ask(name: str) -> str:
            request = wire.Request()
            request.get_component.component = name
            return str((await link.request(request, DEADLINE_S)).component.full_name)

        answers = await asyncio.gather(ask("a"), ask("b"), ask("c"))
        assert list(answers) == ["a", "b", "c"]

    against(tmp_path, peer, test)


def test_an_unknown_reason_of_a_newer_executor_is_that_of_the_kind(tmp_path: Path) -> None:
    async def peer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        response = wire.Response(id=(await received(reader)).id)
        response.error.code = wire.Error.CODE_INVALID_ARGUMENT
        response.error.message = "no"
        # Field 3, an enum, with a value that does not exist yet.
        response.error.MergeFromString(b"\x18\xb9\x60")
        assert response.error.reason == 12345
        writer.write(pack_message(response.SerializeToString()))

    async def test(link: Link) -> None:
        with pytest.raises(errors.InvalidArgument, match="no") as raised:
            await link.request(wire.Request(get_status=STATUS), DEADLINE_S)
        assert raised.value.reason == errors_pb2.REASON_VALUE_INVALID

    against(tmp_path, peer, test)


def test_a_timeout_is_unavailable(tmp_path: Path) -> None:
    async def peer(reader: asyncio.StreamReader, _: asyncio.StreamWriter) -> None:
        await reader.read()

    async def test(link: Link) -> None:
        with pytest.raises(errors.Unavailable, match=r"did not answer get_status within 0\.01 s"):
            await link.request(wire.Request(get_status=STATUS), 0.01)

    against(tmp_path, peer, test)


@pytest.mark.parametrize(
    "reply",
    [
        b"",
        b"\x01\x00",
        (MAX_MESSAGE + 1).to_bytes(4, "little"),
        pack_message(b"\xff\xff\xff"),
    ],
    ids=["end of stream", "half a length", "too long", "no message"],
)
def test_a_broken_connection_fails_waiting_requests(tmp_path: Path, reply: bytes) -> None:
    async def peer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await received(reader)
        writer.write(reply)
        writer.close()

    async def test(link: Link) -> None:
        with pytest.raises(errors.Unavailable, match="the peer"):
            await link.request(wire.Request(get_status=STATUS), DEADLINE_S)
        assert link.ended.is_set()
        with pytest.raises(errors.Unavailable, match="the peer"):
            await link.request(wire.Request(get_status=STATUS), DEADLINE_S)

    against(tmp_path, peer, test)


def test_both_sides_send_their_protocol_version(tmp_path: Path) -> None:
    async def peer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        request = await received(reader)
        answer = wire.HelloResult(protocol=request.hello.protocol + 7)
        response = wire.Response(id=request.id, hello=answer)
        writer.write(pack_message(response.SerializeToString()))

    async def test(link: Link) -> None:
        assert (await link.hello(DEADLINE_S)).protocol == PROTOCOL + 7

    against(tmp_path, peer, test)
