"""Crashes within functions of a library, for tests of source lines."""

import asyncio
import subprocess
from pathlib import Path

from rtcfd.common.background import WorkerThreads
from rtcfd.executor import source_lines
from rtcfd.executor.flight_recorder import Trace

PROGRAM = "/nowhere/rtcf-executor"


def trace_of(library: Path, mapped: str, functions: tuple[str, ...]) -> Trace:
    """Return a crash within functions of a library that is mapped under a name."""
    symbols = subprocess.run(["nm", "-S", str(library)], capture_output=True, text=True, check=True)
    places = []
    for name in functions:
        (row,) = [each.split() for each in symbols.stdout.splitlines() if name in each]
        places.append(int(row[0], 16) + int(row[1], 16) // 2)
    segments = subprocess.run(
        ["readelf", "-lW", str(library)], capture_output=True, text=True, check=True
    )
    base, lines = 0x7F0000000000, []
    for words in map(str.split, segments.stdout.splitlines()):
        if words[:1] == ["LOAD"] and "E" in words[6:-1]:
            offset, address, size = (int(words[at], 16) for at in (1, 2, 4))
            begin = base + address
            lines.append(f"{begin:x}-{begin + size:x} r-xp {offset:08x} 00:01 77   {mapped}")
    lines.append(f"{base * 2:x}-{base * 2 + 4096:x} r-xp 00000000 00:01 78   {PROGRAM}")
    return Trace((*(base + each for each in places), base * 2 + 16), "\n".join(lines))


def find(trace: Trace, *libraries: Path) -> source_lines.Found:
    """Return the source lines of a crash."""

    async def run() -> source_lines.Found:
        return await source_lines.find(
            trace, map(str, libraries), PROGRAM, WorkerThreads("folders")
        )

    return asyncio.run(run())
