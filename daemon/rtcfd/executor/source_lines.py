"""Finds the source lines of a crash, by addr2line in a process of its own.

A component's debug information is as untrusted as its code, so neither the crashing process nor
rtcfd reads it.  Stateless.
"""

import asyncio
import contextlib
import os
import re
import shutil
import signal
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from rtcfd.common.background import WorkerThreads
from rtcfd.executor.flight_recorder import Trace

_READ_TIMEOUT_S = 2.0  # for the headers of one file
_TIMEOUT_S = 10.0  # for addr2line, on one file
_LONGEST_ANSWER = 256 * 1024
_LONGEST_FUNCTION = 200
_MOST_SHOWN = 12  # frames
_LOADED = 1  # PT_LOAD
_MAPPING = re.compile(r"([0-9a-f]+)-([0-9a-f]+) ..x. ([0-9a-f]+) \S+ \d+\s+(\S.*)")
_COPY = re.compile(r"/memfd:(.*) \(deleted\)")
_PLACE = re.compile(r"(.*) at (\S+:\d+)(?: \(discriminator \d+\))?")


@dataclass(frozen=True)
class _Mapping:
    begin: int
    end: int
    offset: int
    file: str


@dataclass(frozen=True)
class _Frame:
    """A place in the code: `file` is the path to read, `name` is for messages."""

    file: str
    name: str
    offset: int  # in the file


@dataclass(frozen=True)
class Found:
    """The stack frames of a crash, innermost first: function and source line, as far as known.

    `place` is the first frame in a component, else the first of all.
    """

    place: str = ""
    lines: tuple[str, ...] = ()


async def find(
    trace: Trace, libraries: Iterable[str], program: str, folders: WorkerThreads
) -> Found:
    """Find the source lines of a crash; raises Unavailable if a disk does not answer.

    `libraries` are the library files of the components, without those that have changed since.
    `program` is the executor, whose own frames at the outer end are left out.  `folders` runs
    the reads.
    """
    known = set(libraries)
    frames = _placed(trace, known)
    own = next((i for i, each in enumerate(frames) if each.file == program), len(frames))
    # A crash in the executor itself keeps all frames.
    frames = (frames[:own] or frames)[:_MOST_SHOWN]
    by_file: dict[str, list[_Frame]] = {}
    for frame in frames:
        by_file.setdefault(frame.file, []).append(frame)
    tool = shutil.which("addr2line")
    lines: dict[_Frame, str] = {}
    for file, those in by_file.items():
        if tool and file:
            lines.update(zip(those, await _lines(tool, file, those, folders), strict=False))
    found = tuple(lines.get(each) or _where(each) for each in frames)
    inside = (line for line, frame in zip(found, frames, strict=True) if frame.file in known)
    return Found(next(inside, found[0] if found else ""), found)


def _placed(trace: Trace, libraries: set[str]) -> list[_Frame]:
    mappings = _mappings(trace.maps)
    frames = []
    for depth, address in enumerate(trace.frames):
        # A return address belongs to the instruction after the call.
        at = address - (depth > 0)
        found = next((each for each in mappings if each.begin <= at < each.end), None)
        if found is None:
            if depth == 0:
                frames.append(_Frame("", f"no code at {address:#x}", 0))
            continue
        file = name = found.file
        if copy := _COPY.fullmatch(found.file):
            name = copy[1]
            named = {each for each in libraries if Path(each).name == name}
            file = named.pop() if len(named) == 1 else ""
        frames.append(_Frame(file, Path(name).name, at - found.begin + found.offset))
    return frames


def _mappings(maps: str) -> list[_Mapping]:
    found = (_MAPPING.fullmatch(line) for line in maps.splitlines())
    return [
        _Mapping(int(each[1], 16), int(each[2], 16), int(each[3], 16), each[4])
        for each in found
        if each
    ]


def _where(frame: _Frame) -> str:
    return f"{frame.name}+{frame.offset:#x}" if frame.offset else frame.name


async def _lines(tool: str, file: str, frames: list[_Frame], folders: WorkerThreads) -> list[str]:
    """Return addr2line's answers for places in one file; empty where it finds nothing."""
    try:
        addresses = await folders.run(
            lambda: [_linked(Path(file), each.offset) for each in frames], _READ_TIMEOUT_S
        )
    except (OSError, ValueError, struct.error):
        return []
    # With -i: the function at the address, then those into which it is inlined.
    command = [tool, "-C", "-f", "-i", "-p", "-s", "-e", file, *map(hex, addresses)]
    output = await _run(command)
    found = (each for each in output.splitlines() if not each.startswith(" (inlined by) "))
    lines: list[str] = []
    for line, frame in zip(found, frames, strict=False):
        if line.startswith("??"):
            lines.append("")
        elif place := _PLACE.fullmatch(line):
            lines.append(f"{place[1][:_LONGEST_FUNCTION]} at {place[2]}")
        else:
            function = line.partition(" at ")[0][:_LONGEST_FUNCTION]
            lines.append(f"{function} in {_where(frame)}")
    return lines


async def _run(command: list[str]) -> str:
    process = await asyncio.create_subprocess_exec(
        *command,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        env={"LC_ALL": "C.UTF-8"},
        start_new_session=True,
    )
    assert process.stdout is not None
    data = b""
    try:
        async with asyncio.timeout(_TIMEOUT_S):
            while (more := await process.stdout.read(65536)) and len(data) < _LONGEST_ANSWER:
                data += more
    except TimeoutError:
        return ""
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        while await process.stdout.read(65536):
            pass
        await process.wait()
    return data.decode(errors="replace")


def _linked(file: Path, offset: int) -> int:
    """Return the linked address of an offset in a 64-bit ELF file.

    Raises OSError, ValueError, struct.error.
    """
    with file.open("rb") as content:
        head = content.read(64)
        if head[:6] != b"\x7fELF\x02\x01":
            raise ValueError(f"{file} is not a 64-bit ELF file")
        (headers,) = struct.unpack_from("<Q", head, 32)
        size, count = struct.unpack_from("<HH", head, 54)
        content.seek(headers)
        table = content.read(size * count)
    for i in range(count):
        kind, _, at, address, _, length = struct.unpack_from("<IIQQQQ", table, i * size)
        if kind == _LOADED and at <= offset < at + length:
            return int(offset - at + address)
    raise ValueError(f"no loaded segment of {file} contains {offset:#x}")
