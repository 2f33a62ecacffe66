"""The WebSocket of a scope's page, as its server sees it."""

import json
import struct
from typing import Any

import aiohttp
import numpy as np
from daemon_process import DEADLINE_S
from numpy.typing import NDArray
from scope_process import ScopeProcess

HEAD = struct.Struct("<BBHIIIdd8x")  # as in rtcf_scope.wire
CYCLES, SHOT = 1, 2
FIXED = 4  # columns before the traces


class ScopePage:
    """A connected page."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.texts: list[dict[str, Any]] = []
        self._is_new = False  # whether the last message is unread, for `text`

    async def say(self, **words: Any) -> None:
        """Send the watched signals or the trigger."""
        await self._socket.send_json(words)

    async def send(self, text: str) -> None:
        """Send any text."""
        await self._socket.send_str(text)

    async def text(self, kind: str) -> dict[str, Any]:
        """Return the next text message of a kind."""
        while True:
            await self._hear(-1)
            if self.texts and self.texts[-1]["kind"] == kind and self._is_new:
                return self.texts[-1]

    async def told(self, kind: str) -> dict[str, Any]:
        """Return the last text message of a kind, or the next one if there was none."""
        found = [each for each in self.texts if each["kind"] == kind]
        return found[-1] if found else await self.text(kind)

    async def binary(
        self, kind: int, traces: int | None = None
    ) -> tuple[tuple[Any, ...], NDArray[np.float64]]:
        """Return head and columns of the next binary message of a kind with `count` traces."""
        while True:
            found = await self._hear(kind)
            if found is not None and traces in (None, len(found[1]) - FIXED):
                return found

    async def _hear(self, kind: int) -> tuple[tuple[Any, ...], NDArray[np.float64]] | None:
        message = await self._socket.receive(DEADLINE_S)
        self._is_new = message.type == aiohttp.WSMsgType.TEXT
        if self._is_new:
            self.texts.append(json.loads(message.data))
        elif message.type != aiohttp.WSMsgType.BINARY:
            raise AssertionError(f"the server hung up: {message}")
        elif message.data[0] == kind:
            head = HEAD.unpack_from(message.data)
            return head, np.frombuffer(message.data[HEAD.size :]).reshape(head[4], head[3])
        return None


class Visit:
    """A page's WebSocket, for an `async with`."""

    def __init__(self, scope: ScopeProcess, runner: str = "") -> None:
        self._scope = scope
        self._runner = runner

    async def __aenter__(self) -> ScopePage:
        self.http = aiohttp.ClientSession(headers={"Authorization": f"Bearer {self._scope.token}"})
        address = f"http://127.0.0.1:{self._scope.port}"
        return ScopePage(
            await self.http.ws_connect(
                f"{address}/stream?runner={self._runner}", origin=address, max_msg_size=0
            )
        )

    async def __aexit__(self, *_: object) -> None:
        await self.http.close()
