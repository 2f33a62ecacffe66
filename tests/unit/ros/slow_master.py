#!/usr/bin/python3
"""A ROS master to which the way is long: relays to a real one, and takes its time for a word.

slow_master.py PORT REAL_PORT MILLISECONDS   the test ends it

Prints how many withdrawals are on their way at once, whenever they are more than ever before.
"""

import asyncio
import sys

_PORT, _REAL_PORT, _MILLISECONDS = (int(word) for word in sys.argv[1:])
_withdrawals: set[asyncio.StreamReader] = set()
_most = 0


def _note(calls: asyncio.StreamReader, data: bytes) -> None:
    global _most
    if b"unregister" in data:
        _withdrawals.add(calls)
    if len(_withdrawals) > _most:
        _most = len(_withdrawals)
        print(_most, flush=True)


async def _call(calls: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await calls.read(65536):
        _note(calls, data)
        await asyncio.sleep(_MILLISECONDS / 1000)
        writer.write(data)
    writer.close()


async def _answer(
    answers: asyncio.StreamReader, writer: asyncio.StreamWriter, calls: asyncio.StreamReader
) -> None:
    while data := await answers.read(65536):
        _withdrawals.discard(calls)
        writer.write(data)
    writer.close()


async def _relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    try:
        answers, calls = await asyncio.open_connection("127.0.0.1", _REAL_PORT)
        await asyncio.gather(_call(reader, calls), _answer(answers, writer, reader))
    except OSError:  # one of both has gone, or is not there yet
        pass
    finally:
        _withdrawals.discard(reader)
        writer.close()


async def _serve() -> None:
    server = await asyncio.start_server(_relay, "127.0.0.1", _PORT)
    await server.serve_forever()


asyncio.run(_serve())
