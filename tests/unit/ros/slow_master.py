#!/usr/bin/python3
"""A ROS master to which the way is long: relays to a real one, and takes its time for a word.

slow_master.py PORT REAL_PORT MILLISECONDS   the test ends it
"""

import asyncio
import sys

_PORT, _REAL_PORT, _MILLISECONDS = (int(word) for word in sys.argv[1:])


async def _carry(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, delay_s: float
) -> None:
    while data := await reader.read(65536):
        await asyncio.sleep(delay_s)
        writer.write(data)
    writer.close()


async def _relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    try:
        answers, calls = await asyncio.open_connection("127.0.0.1", _REAL_PORT)
        await asyncio.gather(
            _carry(reader, calls, _MILLISECONDS / 1000), _carry(answers, writer, 0.0)
        )
    except OSError:  # one of both has gone, or is not there yet
        pass
    finally:
        writer.close()


async def _serve() -> None:
    server = await asyncio.start_server(_relay, "127.0.0.1", _PORT)
    await server.serve_forever()


asyncio.run(_serve())
