"""A reader of the fields of an MCAP record."""

import struct
from collections.abc import Iterator


class Fields:
    """Reads the fields of a record in order; raises struct.error if the record is too short."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def numbers(self, form: str) -> tuple[int, ...]:
        """Return the next numbers, by a format of struct."""
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
