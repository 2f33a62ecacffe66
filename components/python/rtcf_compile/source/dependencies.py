"""The files that Python reads when it runs the sources: modules, and data such as tables. The text
of a module is kept as Python ran it, since the file may be saved during a compilation.
"""

import importlib
import importlib.util
import io
import linecache
import os
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rtcf

import rtcf_compile
from rtcf_compile.source.mistake import Mistake

_SYSTEM = tuple(
    f"{each}/"
    for each in (
        *("/usr", "/etc", "/lib", "/proc", "/sys", "/dev"),
        sysconfig.get_path("stdlib"),
        *(str(Path(each.__path__[0]).resolve()) for each in (rtcf, rtcf_compile)),
    )
)
_RESOLUTION_NS = 50_000_000  # of the times of files
_recorded: set[str] = set()
_machinery: Any = importlib.import_module("importlib._bootstrap_external")
_to_code = _machinery.SourceLoader.source_to_code
_is_recording = False
_is_hooked = False


@contextmanager
def recorded() -> Iterator[None]:
    """Record the files that Python opens in the context; keep the texts of modules that it runs."""
    global _is_recording, _is_hooked
    if not _is_hooked:
        sys.addaudithook(_note)  # it stays as long as the process
        _is_hooked = True
    before = set(sys.modules)
    _is_recording = True
    place_of = _machinery.cache_from_source
    _machinery.cache_from_source = _place
    _machinery.SourceLoader.source_to_code = _code_of
    try:
        yield
    finally:
        _machinery.cache_from_source = place_of
        _machinery.SourceLoader.source_to_code = _to_code
        _is_recording = False
        # Python opens compiled files in place of unchanged modules.
        for name in set(sys.modules) - before:
            file = getattr(sys.modules[name], "__file__", None)
            if isinstance(file, str):
                _recorded.add(file)


def _code_of(loader: Any, data: bytes, path: Any, **options: Any) -> Any:
    """Return the code of a module, and keep its text for `inspect`; raise Mistake if it has another
    encoding than it says.
    """
    name = os.fsdecode(path)
    if not os.path.realpath(name).startswith(_SYSTEM):
        try:
            text = importlib.util.decode_source(data)
        except UnicodeDecodeError as error:
            line = data[: error.start].count(b"\n") + 1
            what = f"byte {error.object[error.start]:#04x} is not {error.encoding.upper()}"
            raise Mistake(name, line, what, "save the file in this encoding") from None
        # str.splitlines() would also split at form feeds. Without a time, no later save is read.
        lines = io.StringIO(f"{text}\n").readlines()
        linecache.cache[name] = (len(text), None, lines, name)
    return _to_code(loader, data, path, **options)


def _place(path: Any, *options: Any, **named: Any) -> str:
    """Return the place of a compiled file of Python; there is none for a file that may change.

    For Python, one is fresh if the source had the same size and was saved in the same second.
    """
    if not os.path.realpath(path).startswith(_SYSTEM):
        raise NotImplementedError
    return importlib.util.cache_from_source(path, *options, **named)


def files() -> list[str]:
    """Return the absolute paths of all files that were recorded and that may change."""
    found = {os.path.realpath(each) for each in _recorded}
    return sorted(
        each
        for each in found
        if not each.startswith(_SYSTEM) and not each.endswith(".pyc") and os.path.isfile(each)
    )


def set_time(library: Path, begin_ns: int) -> None:
    """Make a library older than files that were saved since the compilation began, for make."""
    before_ns = begin_ns - _RESOLUTION_NS
    if any(os.stat(each).st_mtime_ns >= before_ns for each in files()):
        os.utime(library, ns=(before_ns, before_ns))


def rule(target: Path) -> str:
    """Return a rule for make: the target depends on the files."""
    words = [f"{_escaped(str(target))}:", *map(_escaped, files())]
    return " \\\n  ".join(words) + "\n"


def _escaped(path: str) -> str:
    return path.replace("$", "$$").replace("#", "\\#").replace(" ", "\\ ")


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    if not _is_recording or event != "open":
        return
    path, _, flags = arguments
    is_read = not isinstance(flags, int) or flags & os.O_ACCMODE == os.O_RDONLY
    if is_read and isinstance(path, str | bytes | os.PathLike):
        _recorded.add(os.path.abspath(os.fsdecode(path)))
