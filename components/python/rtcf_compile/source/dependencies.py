"""The files that Python reads when it runs the sources: modules, and data such as tables."""

import importlib
import importlib.util
import os
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rtcf

import rtcf_compile

_SYSTEM = tuple(
    f"{each}/"
    for each in (
        *("/usr", "/etc", "/lib", "/proc", "/sys", "/dev"),
        sysconfig.get_path("stdlib"),
        *(str(Path(each.__path__[0]).resolve()) for each in (rtcf, rtcf_compile)),
    )
)
_recorded: set[str] = set()
_machinery: Any = importlib.import_module("importlib._bootstrap_external")
_is_recording = False
_is_hooked = False


@contextmanager
def recorded() -> Iterator[None]:
    """Record the files that Python opens in the context."""
    global _is_recording, _is_hooked
    if not _is_hooked:
        sys.addaudithook(_note)  # it stays as long as the process
        _is_hooked = True
    before = set(sys.modules)
    _is_recording = True
    place_of = _machinery.cache_from_source
    _machinery.cache_from_source = _place
    try:
        yield
    finally:
        _machinery.cache_from_source = place_of
        _is_recording = False
        # Python opens compiled files in place of unchanged modules.
        for name in set(sys.modules) - before:
            file = getattr(sys.modules[name], "__file__", None)
            if isinstance(file, str):
                _recorded.add(file)


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
