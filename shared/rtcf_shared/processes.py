"""The state of other processes."""

from pathlib import Path


def is_frozen(pid: int) -> bool:
    """Return whether a signal or a debugger has stopped a process; False if it is not visible."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return text.rpartition(")")[2].split()[0] in ("T", "t")  # see proc(5)
