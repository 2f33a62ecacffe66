"""Frames are copied at the incident, even while another incident's file is being written."""

import asyncio
import os
import struct
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from daemon_process import DEADLINE_S
from rtcf.v1 import control_pb2
from rtcf_shared.mcap_writer import McapWriter
from rtcfd.common.errors import Unavailable
from rtcfd.common.limits import Limits
from rtcfd.incidents import frame_file, frame_memory, head, incident_files
from rtcfd.incidents.incident_files import Incidents
from rtcfd.operations import keep_incident
from rtcfd.operations.keep_incident import keep, take
from rtcfd_in_process import Rtcfd, until


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

    monkeypatch.setattr(incident_files, "_write", slow_write)
    # The loop continues to fill these frames.
    frames = _frames(b"before")

    def facts(runner: str) -> dict[str, Any]:
        return {"runner": runner, "time_ns": time.time_ns()}

    async def play() -> None:
        kept = Incidents(tmp_path / "incidents", Limits)
        first = asyncio.create_task(kept.keep(_frames(b"other"), facts("one")))
        try:
            await until(writing.is_set, "the first file")
            copies = threading.Event()
            copied = frame_memory.copied

            def copy(descriptor: int) -> int:
                frozen = copied(descriptor)
                copies.set()
                return frozen

            monkeypatch.setattr(frame_memory, "copied", copy)
            second = asyncio.create_task(kept.keep(os.dup(frames), facts("two")))
            await until(copies.is_set, "the copy of the second one's frames")
            os.pwrite(frames, b"behind", 0)
        finally:
            may_write.set()
        await asyncio.gather(first, second)

    asyncio.run(play())
    os.close(frames)
    assert written == [b"other", b"before"]


@pytest.fixture
def held_writing(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[threading.Event, Any]]:
    """Block writes of files until an event; yield it and an event set at the start of a write."""
    begun, may_write = threading.Event(), threading.Event()

    def held(_: int, file: Path, __: Any) -> None:
        begun.set()
        may_write.wait()
        file.write_bytes(b"")

    monkeypatch.setattr(incident_files, "_write", held)
    yield begun, may_write
    may_write.set()


def test_incidents_are_listed_and_removed_while_another_is_written(
    tmp_path: Path, held_writing: tuple[threading.Event, Any]
) -> None:
    begun, may_write = held_writing
    folder = tmp_path / "incidents"
    folder.mkdir()
    (folder / "old.mcap").write_bytes(b"")

    async def play() -> None:
        kept = Incidents(folder, Limits)
        facts = {"runner": "one", "time_ns": time.time_ns()}
        keeping = asyncio.create_task(kept.keep(_frames(b""), facts))
        await until(begun.is_set, "the file of the new one")
        try:
            async with asyncio.timeout(DEADLINE_S):
                assert [each.name for each in await kept.all()] == ["old"]
                assert (await kept.get("old")).name == "old"
                assert [each.name for each in await kept.remove(["old"])] == ["old"]
            assert not keeping.done()
        finally:
            may_write.set()
        name = (await keeping).name
        assert [each.name for each in await kept.all()] == [name]

    asyncio.run(play())


def test_a_runner_is_removed_while_its_incident_is_written(
    rtcfd: Callable[[], Rtcfd], held_writing: tuple[threading.Event, Any]
) -> None:
    begun, may_write = held_writing

    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        kept = daemon.runners.incidents
        await daemon.call("AddRunner", control_pb2.AddRunnerRequest(runner="arm"))
        runner = daemon.runners.get("arm")
        executor = runner.alive()
        executor.frames = _frames(b"")
        keep(runner, executor, "a crash")
        await until(begun.is_set, "the incident's file")
        try:
            async with asyncio.timeout(DEADLINE_S):
                await daemon.call("RemoveRunner", control_pb2.RemoveRunnerRequest(runner="arm"))
            assert not await kept.all()
        finally:
            may_write.set()
        # rtcfd ends with a complete file.
        await daemon.runners.close(in_order=True)
        (incident,) = await kept.all()
        assert incident.file.endswith("-arm.mcap")

    asyncio.run(play())


def test_an_incident_names_the_change_that_caused_it(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[dict[str, Any]] = []

    def note(_: int, file: Path, facts: dict[str, Any]) -> None:
        written.append(facts)
        file.write_bytes(b"")

    monkeypatch.setattr(incident_files, "_write", note)

    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        runner = daemon.runners.get("rt_runner")
        executor = runner.alive()
        executor.frames = _frames(b"")
        answered = asyncio.Event()

        async def work() -> None:
            await answered.wait()
            runner.happened(control_pb2.Event.KIND_PARAMETERS, "gain = nan", "/a")

        change = asyncio.create_task(runner.change("the set", work))
        await asyncio.sleep(0)
        keep(runner, executor, "the fault that it causes")
        await asyncio.sleep(0.05)
        assert written == []
        answered.set()
        await change
        await until(lambda: written, "the incident")
        await daemon.runners.close(in_order=True)

    asyncio.run(play())
    assert [each.message for each in written[0]["events"]][-1] == "gain = nan"


def test_taking_an_incident_is_answered_while_the_disk_hangs(
    rtcfd: Callable[[], Rtcfd],
    held_writing: tuple[threading.Event, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, may_write = held_writing
    monkeypatch.setattr(keep_incident, "TAKE_TIMEOUT_S", 0.1)

    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        runner = daemon.runners.get("rt_runner")
        runner.alive().frames = _frames(b"")
        with pytest.raises(Unavailable, match=r"not written after 0\.1 s: does the disk"):
            await take(runner, "a test")
        may_write.set()
        # rtcfd ends with a complete file.
        await daemon.runners.close(in_order=True)
        assert len(await daemon.runners.incidents.all()) == 1

    asyncio.run(play())


def _memory(rings: int, frames: int) -> int:
    """Return rings of frames without values, all complete."""
    words = frame_memory.HEAD_WORDS
    bytes_of_ring = frames * words * frame_memory.WORD.size
    begin = frame_memory.entry_at(frame_memory.ENTRIES)
    memory = bytearray(begin + rings * bytes_of_ring)
    frame_memory.HEAD.pack_into(memory, 0, frame_memory.MAGIC, frame_memory.VERSION)
    for ring in range(rings):
        offset = begin + ring * bytes_of_ring
        entry = (ring + 1, offset, frames, words, 0, 0)
        frame_memory.ENTRY.pack_into(memory, frame_memory.entry_at(ring), *entry)
        for number in range(frames):
            at = offset + number * words * frame_memory.WORD.size
            struct.pack_into("<2Q", memory, at, 2 * number + 2, number)
    return _frames(bytes(memory))


def test_frames_overwritten_during_the_copy_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    live = _memory(rings=2, frames=8)
    copy_all = frame_memory._copy

    def copy_and_write_on(own: int, copy: int, size: int) -> None:
        copy_all(own, copy, size)
        first, second = (
            frame_memory.ENTRY.unpack(os.pread(live, 48, frame_memory.entry_at(i))) for i in (0, 1)
        )
        # The first ring is being reused; in the second, frame 0 has been replaced by frame 8, and
        # frame 1 is being written.
        os.pwrite(live, struct.pack("<Q", 3), frame_memory.entry_at(0))
        assert first[0] == 1
        for place, mark in ((0, 2 * 8 + 2), (1, 2 * 9 + 1)):
            at = second[1] + place * frame_memory.HEAD_WORDS * frame_memory.WORD.size
            os.pwrite(live, struct.pack("<Q", mark), at)

    monkeypatch.setattr(frame_memory, "_copy", copy_and_write_on)
    copy = frame_memory.copied(live)
    (ring,) = frame_file.read(copy)
    os.close(copy)
    os.close(live)
    assert ring.cycles.tolist() == [2, 3, 4, 5, 6, 7]


def _written(_: int, file: Path, facts: dict[str, Any]) -> None:
    """Write only the description of an incident's file."""
    pairs = {"runner": facts["runner"], "time_ns": str(facts["time_ns"])}
    if "sequence" in facts:
        pairs["sequence"] = str(facts["sequence"])
    with file.open("xb") as out:
        writer = McapWriter(out)
        writer.metadata(head.NAME, pairs)
        writer.close()


def test_stored_incidents_are_listed_while_another_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writing, may_write = threading.Event(), threading.Event()

    async def play() -> None:
        kept = Incidents(tmp_path / "incidents", Limits)
        monkeypatch.setattr(incident_files, "_write", _written)
        first = await kept.keep(_frames(b"one"), {"runner": "one", "time_ns": 1})

        def slow_write(frozen: int, file: Path, facts: dict[str, Any]) -> None:
            writing.set()
            may_write.wait()
            _written(frozen, file, facts)

        monkeypatch.setattr(incident_files, "_write", slow_write)
        second = asyncio.create_task(kept.keep(_frames(b"two"), {"runner": "two", "time_ns": 2}))
        try:
            await until(writing.is_set, "the second file")
            async with asyncio.timeout(DEADLINE_S):
                assert await kept.all() == [first]
                assert await kept.get("") == first
                assert await kept.read(first, 0) == Path(first.file).read_bytes()
                assert await kept.remove([first.name]) == [first]
        finally:
            may_write.set()
        last = await second
        assert await kept.all() == [last]

    asyncio.run(play())


def test_damaged_files_and_others_in_the_folder_hinder_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(incident_files, "_write", _written)
    folder = tmp_path / "incidents"
    folder.mkdir()
    numbers = ("nonsense", "-1", "9" * 19, "9" * 400, "²", "", "1e3")
    for place, text in enumerate(numbers):
        facts = {"runner": "arm", "time_ns": text, "sequence": text}
        _written(0, folder / f"number-{place}.mcap", facts)
    whole = (folder / "number-0.mcap").read_bytes()
    for cut in range(0, len(whole), 7):
        (folder / f"cut-{cut}.mcap").write_bytes(whole[:cut])
        damaged = bytearray(whole)
        damaged[cut] ^= 0xFF
        (folder / f"flipped-{cut}.mcap").write_bytes(damaged)
    os.mkfifo(folder / "pipe.mcap")
    (folder / "folder.mcap").mkdir()
    (folder / "nowhere.mcap").symlink_to("gone")
    (folder / "zero.mcap").symlink_to("/dev/zero")

    async def play() -> None:
        kept = Incidents(folder, Limits)
        async with asyncio.timeout(DEADLINE_S):
            there = {each.name for each in await kept.all()}
            assert {f"number-{place}" for place in range(len(numbers))} <= there
            assert not there & {"pipe", "folder", "nowhere", "zero"}
            for _ in range(2):
                new = await kept.keep(_frames(b"x"), {"runner": "arm", "time_ns": time.time_ns()})
                assert await kept.get("") == new
            for name in there:
                await kept.read(await kept.get(name), 0)

    asyncio.run(play())


def test_incidents_are_ordered_by_number_not_by_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(incident_files, "_write", _written)
    hour_ns = 3600 * 10**9

    async def play() -> None:
        # An incident of an rtcfd without numbering is older than all others.
        old = tmp_path / "incidents" / "old.mcap"
        old.parent.mkdir()
        _written(0, old, {"runner": "arm", "time_ns": 1000 * hour_ns})
        for _ in range(2):
            kept = Incidents(tmp_path / "incidents", Limits)  # from another rtcfd
            for now in (500, 100, 300):
                await kept.keep(_frames(b"x"), {"runner": "arm", "time_ns": now * hour_ns})
        found = await kept.all()
        assert [each.sequence for each in found] == list(range(7))
        hours = [each.time_ns // hour_ns for each in found]
        assert hours == [1000, 500, 100, 300, 500, 100, 300]
        assert await kept.get("") == found[-1]
        # The oldest incident is removed first.
        size = found[-1].bytes
        incident_files._tidy(tmp_path / "incidents", 3 * size, Path(found[-1].file))
        assert [each.sequence for each in await kept.all()] == [4, 5, 6]

    asyncio.run(play())
