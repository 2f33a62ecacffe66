"""Processor time of processes and their threads, as counted by the kernel."""

from collections import Counter
from pathlib import Path


def descendants(pid: int) -> list[int]:
    """Return the process ids of all descendants of a process."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # the process has just ended
        parents[int(stat.parent.name)] = int(fields[1])
    found, level = [], [pid]
    while level:
        level = [child for child, parent in parents.items() if parent in level]
        found += level
    return found


def renderers(pid: int) -> list[int]:
    """Return the renderer processes of a Chromium; `pid` is its first process."""
    return [each for each in descendants(pid) if b"--type=renderer" in _read(each, "cmdline")]


def by_thread_ms(pid: int) -> Counter[str]:
    """Return the ms per thread name of a process so far; `main` is its first thread."""
    found: Counter[str] = Counter()
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            name = (task / "comm").read_text().strip()
            run_ns = int((task / "schedstat").read_text().split()[0])
        except OSError:
            continue  # the thread has just ended
        found["main" if task.name == str(pid) else name] += run_ns / 1e6  # type: ignore[assignment]
    return found


def resident_mb(pid: int) -> float:
    """Return the resident memory of a process."""
    for line in _read(pid, "status").decode().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


def _read(pid: int, name: str) -> bytes:
    try:
        return Path(f"/proc/{pid}/{name}").read_bytes()
    except OSError:
        return b""
