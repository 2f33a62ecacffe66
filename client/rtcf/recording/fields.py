"""What stands in a record of an MCAP file, one after the other."""

import struct
from collections.abc import Iterator


class Fields:
    """Reads a record from its begin on; raises struct.error where it ends too early."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def numbers(self, form: str) -> tuple[int, ...]:
        """Return what struct.unpack makes of the next bytes."""
        values = struct.unpack_from(form, self._data, self._at)
        self._at += struct.calcsize(form)
        return values

    def text(self) -> str:
        """Return the next string."""
        (length,) = self.numbers("<I")
        text = self._data[self._at : self._at + length].decode(errors="replace")
        self._at += length
        return text

    def pairs(self) -> dict[str, str]:
        """Return the next map of strings."""
        return dict(self._pairs())

    def _pairs(self) -> Iterator[tuple[str, str]]:
        (length,) = self.numbers("<I")
        end = self._at + length
        while self._at < end:
            yield self.text(), self.text()
