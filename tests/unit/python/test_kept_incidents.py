"""Frames are copied when an incident happens, whatever else is being written just then."""

import asyncio
import os
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from rtcfd.common.limits import Limits
from rtcfd.incidents import incidents
from rtcfd.incidents.incidents import Incidents
from rtcfd_in_process import until


def _frames(data: bytes) -> int:
    descriptor = os.memfd_create("frames")
    os.write(descriptor, data)
    return descriptor


def test_frames_are_copied_while_the_file_of_another_incident_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writing, may_write = threading.Event(), threading.Event()
    written: list[bytes] = []

    def slow_write(frozen: int, file: Path, _: Any) -> None:
        writing.set()
        may_write.wait()
        written.append(os.pread(frozen, 100, 0))
        file.write_bytes(b"")

    monkeypatch.setattr(incidents, "_write", slow_write)
    # What a loop fills on.
    frames = _frames(b"before")

    def facts(runner: str) -> dict[str, Any]:
        return {"runner": runner, "time_ns": time.time_ns()}

    async def play() -> None:
        kept = Incidents(tmp_path / "incidents", Limits)
        first = asyncio.create_task(kept.keep(_frames(b"other"), facts("one")))
        try:
            await until(writing.is_set, "the first file")
            copies = threading.Event()
            copied = incidents._copied

            def copy(descriptor: int) -> int:
                frozen = copied(descriptor)
                copies.set()
                return frozen

            monkeypatch.setattr(incidents, "_copied", copy)
            second = asyncio.create_task(kept.keep(os.dup(frames), facts("two")))
            await until(copies.is_set, "the copy of the second one's frames")
            os.pwrite(frames, b"behind", 0)
        finally:
            may_write.set()
        await asyncio.gather(first, second)

    asyncio.run(play())
    os.close(frames)
    assert written == [b"other", b"before"]
