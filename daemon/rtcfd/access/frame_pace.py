"""Paces the HTTP/2 frames of a client, before they reach gRPC.

gRPC keeps state for each stream that a client opens, even if the client resets it at once, and
answers pings and settings.  The limits of calls come too late: a client that opens and resets
streams (rapid reset, CVE-2023-44487) exhausts the memory of rtcfd without a call.  The kernel
buffers the bytes of a delayed client; when the buffer is full, the client waits.

gRPC limits the calls that a client has at a time, but only after the client has acknowledged
this limit (SETTINGS), so a client must do so before it makes many calls.

Frames are described in RFC 9113, section 4.1.  Owned by the relay of one connection.
"""

from collections.abc import Iterator

from rtcfd.common.pace import Pace

_PREFACE_BYTES = 24  # before the first frame
_HEADER_BYTES = 9  # of a frame: length, type, flags, stream
_KIND, _FLAGS = 3, 4  # places of the type and the flags among them
_HEADERS, _SETTINGS = 1, 4  # types
_ACK = 1  # flag
# Units of the pace by type of frame: DATA, PRIORITY and WINDOW_UPDATE only cost processor time.  A
# call has HEADERS and DATA, and some of the others.
_CHEAP = {0: 1.0, 2: 1.0, 8: 1.0}
_OTHER = 10.0
UNITS_PER_S = 3000.0
MOST_CALLS = 16  # at a time; also those before the acknowledgement
_SHORT_S = 0.05  # waits up to this are put off, so that each frame does not need one of its own


class FramePace:
    """Cuts the bytes of one connection at frames that must wait.

    All connections of a user share a `pace`.
    """

    def __init__(self, pace: Pace) -> None:
        self._pace = pace
        self._skipped = _PREFACE_BYTES  # bytes before the next header
        self._header = b""  # of the next frame, as far as it is known
        self._acknowledged = False
        self._early = 0  # calls before that
        self.evades = False  # the client makes many calls without accepting the limit

    def cut(self, data: bytes, *, paced: bool) -> Iterator[tuple[bytes, float]]:
        """Yield the parts of `data`, each with the seconds to wait after it; not `paced`: 0.

        Ends early, and sets `evades`, before a call by which a paced client evades the limit.
        """
        begin = at = 0
        while at < len(data):
            step = min(self._skipped or _HEADER_BYTES - len(self._header), len(data) - at)
            if self._skipped:
                self._skipped -= step
            else:
                self._header += data[at : at + step]
            at += step
            if len(self._header) < _HEADER_BYTES:
                continue
            kind, flags = self._header[_KIND], self._header[_FLAGS]
            if kind == _SETTINGS and flags & _ACK:
                self._acknowledged = True
            self._early += kind == _HEADERS and not self._acknowledged
            if paced and self._early > MOST_CALLS:
                self.evades = True
                return
            units = _CHEAP.get(kind, _OTHER)
            self._skipped = int.from_bytes(self._header[:_KIND], "big")
            self._header = b""
            if paced and (wait_s := self._pace.take(units)) > _SHORT_S:
                # The end of the frame's header waits, so gRPC does not see the frame.
                yield data[begin : at - step], wait_s
                begin = at - step
        yield data[begin:], 0.0
