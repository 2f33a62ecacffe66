"""Paces the HTTP/2 frames of a client, and limits its calls at a time, before they reach gRPC.

gRPC keeps state for each stream that a client opens, even if the client resets it at once, and
answers pings and settings.  The limits of calls come too late: a client that opens and resets
streams (rapid reset, CVE-2023-44487) exhausts the memory of rtcfd without a call.  The kernel
buffers the bytes of a delayed client; when the buffer is full, the client waits.

gRPC announces its limit of the calls at a time (SETTINGS), but applies it only after the client
has acknowledged it.  It then ends the connection, and grpcio (1.51) loses the memory of calls, 9 kB
each, whose connection ends while it accepts them.  So the relay ends it first.

Frames are described in RFC 9113, section 4.1.  Owned by the relay of one connection.
"""

from collections.abc import Iterator

from rtcfd.common.pace import Pace

_PREFACE_BYTES = 24  # before the first frame of a client
_HEADER_BYTES = 9  # of a frame: length, type, flags, stream
_LENGTH_BYTES, _KIND, _FLAGS, _STREAM = 3, 3, 4, 5  # places among them
_STREAM_BITS = 0x7FFFFFFF
_DATA, _HEADERS, _RESET = 0, 1, 3  # types
_END_STREAM = 1  # flag of DATA and HEADERS
# Units of the pace by type of frame: DATA, PRIORITY and WINDOW_UPDATE only cost processor time.  A
# call has HEADERS and DATA, and some of the others.
_CHEAP = {_DATA: 1.0, 2: 1.0, 8: 1.0}
_OTHER = 10.0
UNITS_PER_S = 3000.0
MOST_CALLS = 16  # at a time; gRPC's limit
_SHORT_S = 0.05  # waits up to this are put off, so that each frame does not need one of its own


class _Frames:
    """Finds the frames in the bytes of one direction."""

    def __init__(self, skipped: int) -> None:
        self._skipped = skipped  # bytes before the next header
        self._header = b""  # of the next frame, as far as it is known

    def headers(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield each header that ends in `data`, and the place where its last part begins."""
        at = 0
        while at < len(data):
            step = min(self._skipped or _HEADER_BYTES - len(self._header), len(data) - at)
            if self._skipped:
                self._skipped -= step
            else:
                self._header += data[at : at + step]
            at += step
            if len(self._header) == _HEADER_BYTES:
                header, self._header = self._header, b""
                self._skipped = int.from_bytes(header[:_LENGTH_BYTES], "big")
                yield at - step, header


class FramePace:
    """Cuts the bytes of one connection at frames that must wait.

    All connections of a user share a `pace`.
    """

    def __init__(self, pace: Pace, most_calls: float = MOST_CALLS) -> None:
        """`most_calls`: limit of the server behind the relay."""
        self._pace = pace
        self._most = most_calls
        self._there = _Frames(_PREFACE_BYTES)
        self._back = _Frames(0)
        self._open: set[int] = set()  # streams of running calls
        self._last = 0  # stream of the last call
        self.evades = False  # the client has more calls at a time than gRPC allows

    def cut(self, data: bytes, *, paced: bool) -> Iterator[tuple[bytes, float]]:
        """Yield the parts of `data`, each with the seconds to wait after it; not `paced`: 0.

        Ends early, and sets `evades`, before a call of a paced client that is above the limit.
        """
        begin = 0
        for place, header in self._there.headers(data):
            kind, stream = header[_KIND], _stream_of(header)
            # gRPC skips streams of even numbers, and does not count them as the last one.
            if kind == _HEADERS and stream % 2 and stream > self._last:
                self._last = stream
                self._open.add(stream)
                if paced and len(self._open) > self._most:
                    self.evades = True
                    return
            elif kind == _RESET:
                self._open.discard(stream)
            if paced and (wait_s := self._pace.take(_CHEAP.get(kind, _OTHER))) > _SHORT_S:
                # The end of the frame's header waits, so gRPC does not see the frame.
                yield data[begin:place], wait_s
                begin = place
        yield data[begin:], 0.0

    def answer(self, data: bytes) -> None:
        """Note the calls that end by gRPC's next bytes to the client."""
        for _, header in self._back.headers(data):
            kind = header[_KIND]
            ends = kind in (_DATA, _HEADERS) and header[_FLAGS] & _END_STREAM
            if ends or kind == _RESET:
                self._open.discard(_stream_of(header))


def _stream_of(header: bytes) -> int:
    return int.from_bytes(header[_STREAM:], "big") & _STREAM_BITS
