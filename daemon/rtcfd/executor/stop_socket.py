"""Stops a loop at its executor's stop socket, when the executor does not answer on its link.

The executor serves this socket in its own thread, so that it may answer although its main
thread hangs.  A frozen executor reads the request when it continues, even if rtcfd has
closed the connection by then.
"""

import asyncio
from pathlib import Path

_LONGEST_ANSWER = 1024  # bytes
_STOPPED = "stopped"


async def stop(socket: Path, patience_s: float) -> bool:
    """Ask for a stop; return whether the executor confirms the end of its loop in time.

    The request stays at the socket in any case, if it was accepted.
    """
    writer: asyncio.StreamWriter | None = None
    try:
        async with asyncio.timeout(patience_s):
            reader, writer = await asyncio.open_unix_connection(socket)
            writer.write(b"stop\n")
            await writer.drain()
            answer = await reader.read(_LONGEST_ANSWER)
    except (OSError, TimeoutError):
        return False
    finally:
        if writer is not None:
            writer.close()
    return answer.decode(errors="replace").strip().partition(":")[0] == _STOPPED
