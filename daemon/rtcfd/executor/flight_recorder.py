"""Reads an executor's flight recorder: the activity of its threads when it died.

The recorder is shared memory of the executor (layout in executor.proto).  rtcfd opens
it at hello and holds it, so that it outlives the process.  Owned by the Executor.
"""

import mmap
import os
import struct
from dataclasses import dataclass
from enum import IntEnum

_HEADER = struct.Struct("<IIQIIIIIIQIIII")
_MAGIC = 0x46435452
_VERSION = 1
_MOST_FRAMES = 64
_TRACE = struct.Struct(f"<Q{_MOST_FRAMES}Q")
_LONGEST_MAPS = 8 * 1024 * 1024
_NAMES = 64
_NAME_BYTES = 128
_HOOKS = (
    "", "constructor", "configure", "start", "stop", "cleanup", "prepare",
    "safe", "takeOver", "wait", "destructor",
)  # fmt: skip


class Thread(IntEnum):
    """Threads of an executor, in the recorder's numbers."""

    NONE = 0
    REALTIME = 1
    GRAPH = 2
    OTHER = 3


@dataclass(frozen=True)
class Note:
    """The content of the recorder at one time."""

    iteration: int = 0
    running: bool = False  # whether the loop runs
    updating: str = ""  # full name of the component whose hook the real-time thread runs
    hooking: str = ""  # full name of the component whose hook the graph thread runs
    hook: str = ""  # hook of `hooking`
    signal: int = 0  # signal of a crash; 0 = none
    thread: int = Thread.NONE  # the crashed thread
    stalled: bool = False  # the executor crashed itself because a cycle did not end
    address: int = 0  # address of the fault
    cycle_hook: str = "update"  # hook of `updating`


@dataclass(frozen=True)
class Trace:
    """The stack of a crash: code addresses, innermost first, and the memory map of the process."""

    frames: tuple[int, ...]
    maps: str  # as /proc/PID/maps


def _hook(number: int) -> str:
    return _HOOKS[number] if number < len(_HOOKS) else f"hook {number}"


class FlightRecorder:
    """The recorder of one executor."""

    def __init__(self, pid: int, descriptor: int) -> None:
        """Open a recorder by its number in the executor; raises OSError or ValueError."""
        # Kept open: the trace of a crash is written behind the mapped page.
        self._file = os.open(f"/proc/{pid}/fd/{descriptor}", os.O_RDONLY | os.O_CLOEXEC)
        try:
            self._memory = mmap.mmap(self._file, 0, prot=mmap.PROT_READ)
        except BaseException:
            os.close(self._file)
            raise
        magic, version, *_ = _HEADER.unpack_from(self._memory)
        if (magic, version) != (_MAGIC, _VERSION):
            self.close()
            raise ValueError(f"it is not a flight recorder of version {_VERSION}")

    def read(self) -> Note:
        """Return the current content."""
        (_, _, iteration, updating, hooking, hook, signal, thread, reason, address, running,
         slots, cycle_hook, _) = _HEADER.unpack_from(self._memory)  # fmt: skip
        return Note(
            iteration=iteration,
            running=bool(running),
            updating=self._name(updating, slots),
            hooking=self._name(hooking, slots),
            hook=_hook(hook),
            signal=signal,
            thread=thread,
            stalled=reason == 1,
            address=address,
            cycle_hook=_hook(cycle_hook) or "update",
        )

    def trace(self) -> Trace | None:
        """Return the stack of a crash; None: there was none, or it is not known."""
        slots = _HEADER.unpack_from(self._memory)[11]
        begin = _NAMES + slots * _NAME_BYTES
        data = os.pread(self._file, _TRACE.size, begin)
        if len(data) < _TRACE.size:
            return None
        count, *frames = _TRACE.unpack(data)
        if not 0 < count <= _MOST_FRAMES:
            return None
        maps = os.pread(self._file, _LONGEST_MAPS, begin + _TRACE.size)
        return Trace(tuple(frames[:count]), os.fsdecode(maps))

    def close(self) -> None:
        """Unmap and close it."""
        self._memory.close()
        os.close(self._file)

    def _name(self, slot: int, slots: int) -> str:
        begin = _NAMES + slot * _NAME_BYTES
        if not 0 < slot < slots or begin + _NAME_BYTES > len(self._memory):
            return ""
        return (
            self._memory[begin : begin + _NAME_BYTES].partition(b"\0")[0].decode(errors="replace")
        )
