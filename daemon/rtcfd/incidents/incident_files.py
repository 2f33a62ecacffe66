"""The incidents: files with the last cycles before a fault, a crash or a stall.

Owned by the daemon, which they never delay: a thread copies the frames, and a process of its own,
with NumPy, writes the file.  If the files exceed the limit, the oldest ones are removed.
"""

import asyncio
import contextlib
import json
import logging
import os
import re
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from google.protobuf import json_format
from rtcf.v1 import errors_pb2, incidents_pb2

import rtcfd
from rtcfd.common import regular_files
from rtcfd.common.errors import NotFound, Unavailable
from rtcfd.common.limits import Limits
from rtcfd.incidents import frame_memory, head

log = logging.getLogger(__name__)

_SUFFIX = ".mcap"
_SEEN = ".seen"  # of an empty file beside one that a client has read
_NAME = re.compile(r"[A-Za-z0-9_.-]+\Z")
_PACE_S = 10.0  # shortest time between two automatic incidents of one runner
_WRITE_TIMEOUT_S = 120.0
_PIECE = 1024 * 1024
_MODULES = Path(rtcfd.__file__).parents[1]
_WRITER = (
    "import sys; sys.path.insert(0, sys.argv[1]); "
    "from rtcfd.incidents import writer; sys.exit(writer.main(sys.argv[2:]))"
)


class Incidents:
    """The incident files in a folder, which is created for the first one."""

    def __init__(self, folder: Path, limits: Callable[[], Limits]) -> None:
        self._folder = folder
        self._limits = limits
        self._threads = ThreadPoolExecutor(1, "rtcfd-incidents")
        # Own threads: a list or a read must not wait for a file that is being written.
        self._readers = ThreadPoolExecutor(2, "rtcfd-incident-list")
        # Own thread: the loop would overwrite the frames while they wait for another file.
        self._copier = ThreadPoolExecutor(1, "rtcfd-frames")
        self._kept: dict[str, float] = {}  # by runner, the time of its last automatic incident
        self._writing = asyncio.Lock()

    def wanted(self, runner: str) -> bool:
        """Return whether to keep an automatic incident: at most one per runner in _PACE_S, because
        a loop may fail again and again."""
        if not self._limits().incidents_mb:
            return False
        now = time.monotonic()
        if now - self._kept.get(runner, -_PACE_S) < _PACE_S:
            return False
        self._kept[runner] = now
        return True

    async def keep(
        self,
        descriptor: int,
        facts: dict[str, Any],
        complete: Callable[[], Awaitable[None]] | None = None,
    ) -> incidents_pb2.Incident:
        """Write a file with the frames of `descriptor`, which is closed, and with the facts.

        `complete` is called after the frames are copied, and may change the facts.
        """
        folder = self._folder
        try:
            frozen = await self._in_thread(frame_memory.copied, descriptor, threads=self._copier)
        finally:
            os.close(descriptor)
        try:
            if complete is not None:
                await complete()
            async with self._writing:
                await self._in_thread(_make, folder)
                stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime(facts["time_ns"] / 1e9))
                name = await self._in_thread(_free_name, folder, f"{stamp}-{facts['runner']}")
                file = folder / (name + _SUFFIX)
                facts["sequence"] = 1 + await self._in_thread(_last_sequence, folder)
                await self._in_thread(_write, frozen, file, facts)
                await self._in_thread(_tidy, folder, self._limits().incidents_mb * 1_000_000, file)
        finally:
            os.close(frozen)
        return await self._look(_incident, file)  # type: ignore[no-any-return]

    async def all(self, runner: str = "") -> list[incidents_pb2.Incident]:
        """Return all incidents, the oldest first."""
        found = await self._look(_all, self._folder)
        return [each for each in found if not runner or each.runner == runner]

    async def get(self, name: str) -> incidents_pb2.Incident:
        """Return an incident by its name; an empty name is the newest."""
        found = await self.all()
        for each in reversed(found):
            if name in ("", each.name):
                return each
        raise _unknown(name, found)

    async def read(self, incident: incidents_pb2.Incident, at: int) -> bytes:
        """Return a piece of the file from byte `at` on; empty at its end."""
        return await self._look(_piece, Path(incident.file), at)  # type: ignore[no-any-return]

    async def note_seen(self, incident: incidents_pb2.Incident) -> None:
        """Note that a client has read the whole file."""
        mark = Path(incident.file).with_suffix(_SEEN)
        with contextlib.suppress(Unavailable):  # a full disk must not hide an incident
            await self._look(mark.touch)

    async def remove(self, names: Sequence[str]) -> list[incidents_pb2.Incident]:
        """Remove files; none of them if there is no incident of one of the names."""
        found = await self.all()
        known = {str(each.name): each for each in found}
        for name in names:
            if name not in known:
                raise _unknown(name, found)
        gone = [known[name] for name in dict.fromkeys(names)]
        for each in gone:
            await self._look(_remove, Path(each.file))
        return gone

    async def _look(self, work: Callable[..., Any], *arguments: Any) -> Any:
        return await self._in_thread(work, *arguments, threads=self._readers)

    async def _in_thread(
        self, work: Callable[..., Any], *arguments: Any, threads: ThreadPoolExecutor | None = None
    ) -> Any:
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(threads or self._threads, work, *arguments)
        except OSError as error:
            raise Unavailable(
                f"incidents in {self._folder}: {error.strerror or error}",
                errors_pb2.REASON_MACHINE_SILENT,
            ) from None


def _unknown(name: str, found: Sequence[incidents_pb2.Incident]) -> NotFound:
    newest = ", ".join(each.name for each in found[-4:])
    there = f"the newest are {newest}" if found else "there are none"
    return NotFound(
        f"there is no incident {name}; {there}" if name else "there are no incidents",
        errors_pb2.REASON_INCIDENT_NOT_FOUND,
    )


def _make(folder: Path) -> None:
    folder.mkdir(mode=0o700, exist_ok=True)
    for left in folder.glob("*.part"):
        left.unlink(missing_ok=True)  # its writer was killed


def _free_name(folder: Path, stem: str) -> str:
    name, number = stem, 1
    while (folder / (name + _SUFFIX)).exists():
        number += 1
        name = f"{stem}-{number}"
    return name


def _write(frozen: int, file: Path, facts: dict[str, Any]) -> None:
    part = file.with_suffix(".part")
    try:
        done = subprocess.run(
            [sys.executable, "-I", "-c", _WRITER, str(_MODULES), str(frozen), str(part)],
            input=json.dumps(facts, default=json_format.MessageToDict).encode(),
            pass_fds=[frozen],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=_WRITE_TIMEOUT_S,
            check=False,
        )
        if done.returncode != 0:
            said = done.stderr.decode(errors="replace").strip().splitlines()
            raise OSError(0, said[-1] if said else f"the writer ended with {done.returncode}")
        part.rename(file)
    except subprocess.TimeoutExpired:
        raise OSError(0, f"the writer did not end within {_WRITE_TIMEOUT_S:g} s") from None
    finally:
        part.unlink(missing_ok=True)


def _tidy(folder: Path, most: int, newest: Path) -> None:
    """Remove the oldest incidents until the rest has at most `most` bytes; the newest stays."""
    room = most
    for each in reversed(_all(folder)):
        file = Path(each.file)
        room -= each.bytes
        if room < 0 and file != newest:
            _remove(file)
            log.info("incident %s removed: the incidents exceed incidents_mb", file.stem)


def _all(folder: Path) -> list[incidents_pb2.Incident]:
    """Return all incidents in the order of their sequence, even if the clock has jumped."""
    found = []
    for each in folder.glob("*" + _SUFFIX):
        with contextlib.suppress(OSError):  # it was just removed, or we may not read it
            if _NAME.match(each.stem):
                found.append(_incident(each))
    # The incidents of an older rtcfd have no number (0), so they come first.
    return sorted(found, key=lambda each: (each.sequence, each.time_ns, each.name))


def _last_sequence(folder: Path) -> int:
    return max((int(each.sequence) for each in _all(folder)), default=0)


def _incident(file: Path) -> incidents_pb2.Incident:
    status = file.stat()
    fields = head.read(file)
    return incidents_pb2.Incident(
        name=file.stem,
        runner=fields.get("runner", ""),
        time_ns=_number(fields, "time_ns", status.st_mtime_ns),
        bytes=status.st_size,
        file=str(file),
        reason=fields.get("reason", ""),
        sequence=_number(fields, "sequence", 0),
        seen=file.with_suffix(_SEEN).exists(),
    )


def _number(fields: Mapping[str, str], key: str, default: int) -> int:
    """Return a number of the description, `default` if the file is damaged there."""
    text = fields.get(key, "")
    # Far below the largest number of the protocol: the next sequence must fit, too.
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 18 else default


def _piece(file: Path, at: int) -> bytes:
    return regular_files.read_piece(file, _PIECE, at)


def _remove(file: Path) -> None:
    file.unlink(missing_ok=True)
    file.with_suffix(_SEEN).unlink(missing_ok=True)
