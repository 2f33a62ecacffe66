"""The kernel's tracer by tracefs: a separate instance, whose pages a thread reads.

See Documentation/trace/ftrace.rst of the kernel.  Other users of the tracer are not affected.
"""

import contextlib
import functools
import mmap
import os
import threading
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from rtcf.errors import RtcfError
from rtcf.kernel.culprit import FAULT_NS, Culprit, Event, LateCycle, Switch, find_culprit
from rtcf.kernel.pages import Decoder, Format, Page

_EVENTS = (
    "sched/sched_switch",
    "sched/sched_waking",
    "irq/irq_handler_entry",
    "irq/irq_handler_exit",
    "irq/softirq_entry",
    "irq/softirq_exit",
)
# Events that only some processors have.
_MORE_EVENTS = ("exceptions/page_fault_user", "exceptions/page_fault_kernel")
_VECTORS = "irq_vectors"
_WAKING = "sched/sched_waking"
_BUFFER_KB = 4096  # of each CPU
_KEPT_BYTES = 64 * 1024 * 1024
_EVERY_S = 0.02
_LONGEST_BACK_NS = 200_000_000  # from a deadline back to the loop's previous turn
_DECODED = 64  # decoded pages in a cache, because consecutive cycles are often late
_MARK = "rtcfctl trace\n"
_FAULTS = 128  # pages touched to measure the time of page faults
_COLDER = 3  # maximum ratio of the time of a page fault in a loop to the measured one


class KernelTrace:
    """The kernel's events on a loop's CPU, traced within a `with` statement by a thread."""

    def __init__(self, thread: int, cpu: int | None) -> None:
        """Trace the loop's thread with the ID `thread`, pinned to `cpu` (None: not pinned)."""
        self._thread = thread
        self._cpu = cpu
        self._pages: deque[Page] = deque()  # in order of time for each CPU
        self._kept = 0  # bytes
        self._lock = threading.Lock()
        self._end = threading.Event()
        self._descriptors: dict[int, int] = {}  # by CPU
        self._problem = ""
        self._read_ns = 0  # all events up to this time have been read

    def __enter__(self) -> "KernelTrace":
        """Start tracing; raises RtcfError if the kernel's trace is not readable."""
        root = _root()
        self._folder = root / "instances" / f"rtcf-{os.getpid()}"
        with _converted_errors(root):
            _remove_left(root / "instances")
            self._folder.mkdir()
            try:
                self._begin()
                self._fault_ns = max(FAULT_NS, _COLDER * _measured_fault_ns())
            except BaseException:
                self._remove()
                raise
        self._reader = threading.Thread(target=self._read, name="kernel-trace", daemon=True)
        self._reader.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end.set()
        self._reader.join()
        self._remove()

    def culprit(self, cycle: LateCycle) -> Culprit:
        """Return the cause of a late cycle for which settled() is true."""
        with self._lock:
            pages = [each for each in self._pages if each.begin_ns <= cycle.end_ns]
        events: list[Event] = []
        for cpu in {each.cpu for each in pages}:
            events += self._since_last_turn([each for each in pages if each.cpu == cpu], cycle)
        events.sort(key=lambda each: each.time_ns)
        return find_culprit(events, self._thread, cycle, self._fault_ns)

    def _since_last_turn(self, pages: list[Page], cycle: LateCycle) -> list[Event]:
        """Return the events of a CPU since the loop's last turn before a deadline."""
        events: list[Event] = []
        # On other CPUs than the loop's, only wake-ups of its thread matter.
        back_ns = 0 if self._cpu not in (None, pages[0].cpu) else _LONGEST_BACK_NS
        for page in reversed(pages):
            found = self._events(page)
            events = found + events
            if page.begin_ns <= cycle.deadline_ns and (
                page.begin_ns < cycle.deadline_ns - back_ns or self._has_turn(found, cycle)
            ):
                break
        return events

    def _has_turn(self, events: list[Event], cycle: LateCycle) -> bool:
        return any(
            isinstance(each, Switch)
            and each.time_ns <= cycle.deadline_ns
            and self._thread in (each.previous, each.next)
            for each in events
        )

    def settled(self, cycle: LateCycle) -> bool:
        """Return whether all events of a cycle have been read, or tracing has failed."""
        return bool(self._problem) or self._read_ns > cycle.end_ns

    @property
    def problem(self) -> str:
        """Why tracing has failed; empty if it has not."""
        return self._problem

    def _begin(self) -> None:
        events = self._folder / "events"
        self._write("tracing_on", "0")
        self._write("trace_clock", "mono")  # the clock of the loop
        self._write("buffer_size_kb", str(_BUFFER_KB))
        names = list(_EVENTS) + [each for each in _MORE_EVENTS if (events / each).is_dir()]
        for entry in sorted((events / _VECTORS).glob("*_entry")):
            stem = entry.name.removesuffix("_entry")
            if (entry.parent / f"{stem}_exit").is_dir():
                names += [f"{_VECTORS}/{stem}_entry", f"{_VECTORS}/{stem}_exit"]
        formats = {}
        for name in names:
            formats[name.rpartition("/")[2]] = (events / name / "format").read_text()
            if name == _WAKING:
                self._write(f"events/{name}/filter", f"pid == {self._thread}")
            elif self._cpu is not None:
                self._write(f"events/{name}/filter", f"CPU == {self._cpu}")
        self._decoder = decoder = Decoder(formats, (events / "header_page").read_text())
        self._events = functools.lru_cache(_DECODED)(lambda page: list(decoder.events(page)))
        for folder in sorted((self._folder / "per_cpu").glob("cpu[0-9]*")):
            flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
            number = int(folder.name.removeprefix("cpu"))
            self._descriptors[number] = os.open(folder / "trace_pipe_raw", flags)
        self._require_own_numbers((events / "ftrace/print/format").read_text())
        for name in names:
            self._write(f"events/{name}/enable", "1")

    def _require_own_numbers(self, text: str) -> None:
        """Raise RtcfError if the kernel's process IDs differ from those of this namespace."""
        described = Format(text)
        self._write("tracing_on", "1")
        with open(self._folder / "trace_marker", "w") as marker:
            marker.write(_MARK)
        self._take_all()
        writers = {
            described.get(data, "common_pid")
            for page in self._pages
            for data in self._decoder.entries(page, described.id)
        }
        if os.getpid() not in writers:
            raise RtcfError(
                "trace --kernel: process IDs in this container differ from the kernel's: run it on "
                "the host"
            )
        self._pages.clear()
        self._kept = 0

    def _write(self, file: str, text: str) -> None:
        (self._folder / file).write_text(text)

    def _read(self) -> None:
        try:
            while not self._end.wait(_EVERY_S):
                begin_ns = time.monotonic_ns()
                self._take_all()
                self._read_ns = begin_ns
        except OSError as error:
            self._problem = f"{error.filename or self._folder}: {error.strerror}"

    def _take_all(self) -> None:
        size = os.sysconf("SC_PAGE_SIZE")
        for cpu, descriptor in self._descriptors.items():
            with contextlib.suppress(BlockingIOError):
                while data := os.read(descriptor, size):
                    self._keep(Page(cpu, data))

    def _keep(self, page: Page) -> None:
        with self._lock:
            self._pages.append(page)
            self._kept += len(page.data)
            while self._kept > _KEPT_BYTES:
                self._kept -= len(self._pages.popleft().data)

    def _remove(self) -> None:
        for descriptor in self._descriptors.values():
            os.close(descriptor)
        with contextlib.suppress(OSError):
            self._folder.rmdir()


def _measured_fault_ns() -> int:
    """Return the time of a page fault on this machine in ns: the minimum of several means."""
    pages = range(0, _FAULTS * mmap.PAGESIZE, mmap.PAGESIZE)

    def touch() -> int:
        begin = time.monotonic_ns()
        for page in pages:
            memory[page] = 1
        return time.monotonic_ns() - begin

    with mmap.mmap(-1, _FAULTS * mmap.PAGESIZE, mmap.MAP_PRIVATE) as memory:
        with contextlib.suppress(OSError):  # a kernel without huge pages
            memory.madvise(mmap.MADV_NOHUGEPAGE)
        means = []
        for _ in range(4):
            memory.madvise(mmap.MADV_DONTNEED)
            means.append((touch() - touch()) // _FAULTS)
    return min(means)


def _root() -> Path:
    """Return the mount point of tracefs; raises RtcfError."""
    for line in Path("/proc/self/mounts").read_text().splitlines():
        _, place, kind, *_ = line.split()
        if kind == "tracefs":
            return Path(place)
    raise RtcfError(
        "trace --kernel: no tracefs is mounted: sudo mount -t tracefs tracefs /sys/kernel/tracing"
    )


@contextlib.contextmanager
def _converted_errors(root: Path) -> Iterator[None]:
    """Convert errors into RtcfError with the file and the remedy."""
    try:
        yield
    except PermissionError:
        raise RtcfError(
            f"trace --kernel: {root} requires root: run it as root (sudo rtcfctl … trace --kernel)"
        ) from None
    except OSError as error:
        raise RtcfError(f"trace --kernel: {error.filename or root}: {error.strerror}") from None
    except (KeyError, ValueError) as error:
        raise RtcfError(f"trace --kernel: unknown format of the kernel's trace: {error}") from None


def _remove_left(instances: Path) -> None:
    """Remove the instances of killed rtcfctl processes."""
    for folder in instances.glob("rtcf-*"):
        number = folder.name.removeprefix("rtcf-")
        if number.isdecimal() and not Path(f"/proc/{number}").exists():
            with contextlib.suppress(OSError):
                folder.rmdir()
