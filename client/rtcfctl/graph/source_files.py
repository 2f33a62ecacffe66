"""The files that a compiled Python source depends on, and whether they have changed."""

import contextlib
import hashlib
import importlib.util
import platform
import re
import sysconfig
import time
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

import rtcf

# A file may change again without a new time, within the resolution of times of files.
_RESOLUTION_NS = 50_000_000
_WORD = re.compile(r"(?:\\.|[^\s\\])+")


def fingerprint(source: Path, others: Iterable[Path] = ()) -> str:
    """Return a hash of everything that the compiled library depends on: the Python files and
    packages in the source's folder, other files that it reads, the compiler, and the runtime that
    is linked into each library.
    """
    digest = hashlib.sha256(compiler_version().encode())
    for file in _files(source, others):
        try:
            if not file.is_file():
                continue  # a pipe, for example
            content = file.read_bytes()
        except OSError:
            continue  # it is being saved
        name = file.name if file.name != "__init__.py" else f"{file.parent.name}/__init__.py"
        digest.update(f"{name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def compiler_version() -> str:
    """Return a hash of the compiler and of the runtime."""
    # A compiled library links shared libraries whose names depend on the release of Debian.
    digest = hashlib.sha256(f"{rtcf.__version__} {_release()}\n".encode())
    own = Path(rtcf.__file__).parent
    files = [*sorted((own / "component").glob("*.py")), own / "linear.py"]
    compiler = importlib.util.find_spec("rtcf_compile")
    if compiler is not None and compiler.origin is not None:
        folder = Path(compiler.origin).parent
        files += sorted(each for each in folder.rglob("*") if each.suffix in (".py", ".hpp"))
        digest.update(f"{_runtime(folder)}\n".encode())
    for name in ("numba", "llvmlite", "numpy"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            digest.update(f"{name} {metadata.version(name)}\n".encode())
    for file in files:
        content = file.read_bytes()
        digest.update(f"{file.name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def dependencies(rule: str) -> list[Path]:
    """Return the files in a rule for make, as rtcf-compile writes it."""
    words = [re.sub(r"\\(.)", r"\1", each) for each in _WORD.findall(rule.replace("\\\n", " "))]
    return [Path(each.replace("$$", "$")) for each in words[1:]]


def _files(source: Path, others: Iterable[Path]) -> list[Path]:
    beside = source.parent
    return sorted({*beside.glob("*.py"), *beside.glob("*/__init__.py"), *others})


def _runtime(compiler: Path) -> str:
    """Return the size and time of the runtime of a compiler, in a build tree or installed."""
    triplet = sysconfig.get_config_var("MULTIARCH") or ""
    for folder in (compiler.parents[1] / "lib", Path("/usr/lib") / triplet):
        try:
            found = (folder / "librtcf_python.a").stat()
        except OSError:
            continue
        return f"{found.st_size} {found.st_mtime_ns}"
    return ""


def _release() -> str:
    try:
        return platform.freedesktop_os_release().get("VERSION_ID", "")
    except OSError:
        return ""


class Changes:
    """Watches the files of a source: compares their content when their times change."""

    def __init__(self, source: Path, others: Iterable[Path]) -> None:
        """Compare with the content at the time of this call."""
        self._source, self._others = source, list(others)
        self._times = self._present_times()
        self.fingerprint = fingerprint(source, self._others)

    def found(self) -> bool:
        """Return whether the content has changed since the last call."""
        now = self._present_times()
        if now == self._times and not _may_change_again(now):
            return False
        before, self._times = self.fingerprint, now
        self.fingerprint = fingerprint(self._source, self._others)
        return self.fingerprint != before

    def watch(self, others: list[Path], compiled: str) -> None:
        """Watch these other files.

        `compiled`: the fingerprint when the source was compiled; "" if that failed.
        """
        if others == self._others:
            return
        self._others, self._times = others, []
        self.fingerprint = compiled or fingerprint(self._source, others)

    def _present_times(self) -> list[tuple[str, int, int, int]]:
        found = []
        for file in _files(self._source, self._others):
            try:
                about = file.stat()
            except OSError:
                continue
            found.append((str(file), about.st_mtime_ns, about.st_size, about.st_ino))
        return found


def _may_change_again(times: list[tuple[str, int, int, int]]) -> bool:
    since = time.time_ns() - _RESOLUTION_NS
    return any(each[1] >= since for each in times)
