"""The writing side of a flight recorder, for the peer executor."""

import mmap
import os
import struct

SLOTS = 16
NAME_BYTES = 128
HEADER = 64


class FlightWriter:
    """A recorder in the executor's layout (see executor.proto)."""

    def __init__(self) -> None:
        size = HEADER + SLOTS * NAME_BYTES
        self.descriptor = os.memfd_create("recorder")
        os.ftruncate(self.descriptor, size)
        self.memory = mmap.mmap(self.descriptor, size)
        self.put(0, 0x46435452)
        self.put(4, 1)
        self.put(52, SLOTS)

    def close(self) -> None:
        self.memory.close()
        os.close(self.descriptor)

    def put(self, offset: int, value: int, form: str = "<I") -> None:
        struct.pack_into(form, self.memory, offset, value)

    def name(self, slot: int, name: str) -> int:
        begin = HEADER + slot * NAME_BYTES
        self.memory[begin : begin + NAME_BYTES] = name.encode().ljust(NAME_BYTES, b"\0")
        return slot

    def loop(self, iteration: int, running: bool) -> None:
        self.put(8, iteration, "<Q")
        self.put(48, int(running))

    def update(self, slot: int) -> None:
        self.put(16, slot)

    def hook(self, slot: int, hook: int) -> None:
        self.put(20, slot)
        self.put(24, hook)

    def crash(self, signal: int, thread: int, *, stalled: bool = False, address: int = 0) -> None:
        self.put(28, signal)
        self.put(32, thread)
        self.put(36, int(stalled))
        self.put(40, address, "<Q")
