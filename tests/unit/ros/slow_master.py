#!/usr/bin/python3
"""A ROS master with a high latency: a relay to a real one that delays each call.

slow_master.py PORT REAL_PORT MILLISECONDS   the test ends it

Prints the number of simultaneous unregistering calls whenever it reaches a new maximum.
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
    except OSError:  # one of the two has ended, or has not started yet
        pass
    finally:
        _withdrawals.discard(reader)
        writer.close()


async def _serve() -> None:
    server = await asyncio.start_server(_relay, "127.0.0.1", _PORT)
    await server.serve_forever()


asyncio.run(_serve())
