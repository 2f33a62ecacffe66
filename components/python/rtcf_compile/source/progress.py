"""Notes the function that is compiled next, for the message if the compiler crashes."""

import mmap

BYTES = 4096
_shared: mmap.mmap | None = None


def note_in(shared: mmap.mmap) -> None:
    """Note in this memory from now on."""
    global _shared
    _shared = shared


def note(file: str, line: int) -> None:
    """Note the place of a function."""
    if _shared is not None:
        text = f"{line}:{file}".encode()[: BYTES - 1]
        _shared[: len(text) + 1] = text + b"\0"


def noted(shared: mmap.mmap) -> tuple[str, int]:
    """Return the file and the line that were noted last."""
    line, _, file = shared[:].partition(b"\0")[0].decode(errors="replace").partition(":")
    return file, int(line or 0)
