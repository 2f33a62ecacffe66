"""Compiles a Python source that is given instead of a package, compares the machine code with the
interpreter, and caches the library.
"""

import argparse
import hashlib
import json
import os
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import rtcf
from rtcf_shared.folders import compiled_folder

from rtcfctl.graph.compiler import Compiler, SingleCompiler, WarmCompiler, program
from rtcfctl.graph.source_files import Changes, compiler_version, dependencies, fingerprint

_POLL_S = 0.2
_VERIFY = "1s"  # processor time of the comparison
_DIFFERENT = 3  # exit status of rtcf-compile if the comparison rejects the component
_MOST_TIMES = 3  # compilations, if files change meanwhile
_RESOLUTION_NS = 50_000_000  # of the times of files


class NotCompiledError(rtcf.RtcfError):
    """The source cannot be compiled; the message has a line for each error."""

    @property
    def lines(self) -> list[str]:
        """The errors."""
        return str(self).splitlines()


def is_source(package: str) -> bool:
    """Return whether the package argument is a Python source."""
    return package.endswith(".py")


def add_option(to: argparse.ArgumentParser) -> None:
    """Add --no-verify."""
    to.add_argument(
        "--no-verify",
        action="store_true",
        help="with FILE.py: do not compare the machine code with the interpreter",
    )


def warm_compiler(build_tree: Path | None) -> WarmCompiler:
    """Return a compiler for several compilations."""
    return WarmCompiler(partial(_program, build_tree), compiler_version)


def compiled(
    source: str,
    build_tree: Path | None,
    progress: Callable[[str], None],
    verify: bool = True,
    compiler: Compiler | None = None,
) -> str:
    """Return the package of a source; compile it unless the cached library is up to date.

    Private daemons find the package.  With `verify`, the machine code of each version of the
    source is compared with the interpreter once.  `progress` receives a line before a compilation.
    Raises NotCompiledError.
    """
    file = Path(source).resolve()
    try:
        if not file.is_file():
            raise NotCompiledError(f"{source}: no such file")
        return _compiled(source, file, build_tree, progress, verify, compiler)
    except OSError as error:
        where = error.filename or compiled_folder()
        raise NotCompiledError(f"{where}: {error.strerror or error}") from None


def _compiled(
    source: str,
    file: Path,
    build_tree: Path | None,
    progress: Callable[[str], None],
    verify: bool,
    compiler: Compiler | None,
) -> str:
    place = _Place(file)
    saved = place.saved()
    current = fingerprint(file, saved.dependencies)
    if saved.fingerprint == current and (saved.is_verified or not verify):
        return place.package
    progress(f"compiling {source} …")
    compiler = compiler or SingleCompiler(_program(build_tree))
    is_compiled = saved.fingerprint == current
    for attempt in range(_MOST_TIMES):
        options = [*(["--verify", _VERIFY] if verify else []), *place.depfile()]
        if not is_compiled:
            options += ["-o", str(place.library)]
            # Until this is saved again, the library may be that of another text.
            place.save(_Saved("", False, saved.dependencies))
        begin_ns = time.time_ns()
        before = place.stamp()
        # A name that begins with - is no option.
        name = f"./{source}" if source.startswith("-") else source
        status, errors = compiler.run([name, *options], progress)
        others = place.dependencies()
        is_current = current == fingerprint(file, saved.dependencies)
        if status != 0 and not is_current and attempt + 1 < _MOST_TIMES:
            # The text that was saved meanwhile may be right.
            saved = _Saved("", False, others)
            current, is_compiled = fingerprint(file, others), False
            continue
        if status == 0 and not is_compiled and place.stamp() == before:
            status, errors = 1, [f"{source}: rtcf-compile has ended without a library"]
        if status != 0:
            place.save(_Saved("", False, others))
            said = "\n".join(errors) or f"rtcf-compile ended with status {status}"
            if status == _DIFFERENT:
                said += f"; `rtcf-compile {source} --verify` shows details, --no-verify skips this"
            raise NotCompiledError(said)
        # A file that was saved meanwhile may be compiled in part.
        new = set(others) - set(saved.dependencies)
        saved = _Saved(fingerprint(file, others), verify, others, place.stamp()[-1])
        if is_current and not any(map(partial(_is_newer, than_ns=begin_ns), new)):
            break
        current, is_compiled = saved.fingerprint, False
    else:
        saved = _Saved("", False, others)  # compiled again at the next load
    # rtcfd loads libraries only from folders without write permission for others; the umask may
    # permit more.
    for each in (place.library, place.library.parent, place.library.parents[1]):
        each.chmod(0o755)
    place.save(saved)
    return place.package


@dataclass(frozen=True)
class _Saved:
    """What is known about a compiled library."""

    fingerprint: str = ""
    is_verified: bool = False
    dependencies: list[Path] = field(default_factory=list)
    size: int = -1  # bytes of the library


class _Place:
    """The files of a source in the cache."""

    def __init__(self, source: Path) -> None:
        # An rtcfd that searches another cache folder must not find its own library of this source.
        path = os.fsencode(source) + b"\0" + os.fsencode(compiled_folder())
        path_hash = hashlib.sha256(path).hexdigest()[:8]
        self.package = f"{_ros_name(source.stem)}_{path_hash}"
        self.library = compiled_folder() / self.package / f"{source.stem}.so"
        # These files are beside the package's folder, which has only libraries.
        self._saved = compiled_folder() / f".{self.package}"
        # Of this process: another may compile the same source.
        self._rule = compiled_folder() / f".{self.package}.{os.getpid()}.d"

    def saved(self) -> _Saved:
        """Return what is known about the library; nothing if there is none."""
        try:
            found = json.loads(self._saved.read_text())
            others = [Path(each) for each in found["dependencies"]]
            size = int(found["size"])
            is_whole = self.stamp()[-1] == size
            known = found["fingerprint"] if is_whole else ""
            return _Saved(known, found["is_verified"], others, size)
        except (OSError, ValueError, LookupError, TypeError):
            return _Saved()

    def stamp(self) -> tuple[int, ...]:
        """Return the number, the time and the size of the library's file; -1 if there is none."""
        try:
            found = self.library.stat()
        except OSError:
            return (-1,)
        return found.st_ino, found.st_mtime_ns, found.st_size

    def save(self, saved: _Saved) -> None:
        """Save what is known about the library."""
        content = {**vars(saved), "dependencies": list(map(str, saved.dependencies))}
        self._saved.parent.mkdir(parents=True, exist_ok=True)
        part = self._saved.with_name(f"{self._saved.name}.{os.getpid()}")
        part.write_text(json.dumps(content))
        part.replace(self._saved)

    def depfile(self) -> list[str]:
        """Return the option for the file of the dependencies."""
        self._rule.parent.mkdir(parents=True, exist_ok=True)
        for file in (self._rule, *self._left()):
            file.unlink(missing_ok=True)
        return ["--depfile", str(self._rule)]

    def _left(self) -> list[Path]:
        """Return the temporary files of interrupted compilations."""
        others = [*self._rule.parent.glob(f".{self.package}.*.d")]
        others += self.library.parent.glob(f".{self.library.name}.*")
        return [each for each in others if not _runs(each.name.removesuffix(".d"))]

    def dependencies(self) -> list[Path]:
        """Return the dependencies of the last compilation, once."""
        try:
            return dependencies(self._rule.read_text())
        except OSError:
            return []
        finally:
            self._rule.unlink(missing_ok=True)


def _runs(name: str) -> bool:
    """Return whether a process runs; its id is the last part of the name."""
    return Path("/proc", name.rpartition(".")[2]).exists()


def _is_newer(file: Path, than_ns: int) -> bool:
    try:
        return file.stat().st_mtime_ns >= than_ns - _RESOLUTION_NS
    except OSError:
        return True


@contextmanager
def found_by_rtcfd(source: str) -> Iterator[None]:
    """Add the remedy to the error of an rtcfd that does not search the compiled libraries.

    `source` is the package argument; nothing changes if it is a package.
    """
    try:
        yield
    except rtcf.RefusedError as error:
        if error.reason != "PACKAGE_NOT_FOUND" or not is_source(source):
            raise
        raise NotCompiledError(
            f"{error}: only a private rtcfd with the same cache folder searches "
            f"{compiled_folder()}, as that of `rtcfctl run`; for this rtcfd, compile into one of "
            f"its folders: `rtcf-compile {source} -o FOLDER/PACKAGE/NAME.so`"
        ) from None


def _ros_name(stem: str) -> str:
    """Return the first part of the package's name; the whole name has at most 64 characters."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)[:48]
    return name if name[:1].isalpha() else f"source_{name}"


def changes(source: str) -> Iterator[bool]:
    """Yield, every 0.2 s, whether the content of a source, of a Python file beside it, or of a file
    that it reads has changed since the last time.  The first comparison is with the content at the
    time of this call, so that a change during a compilation is not missed."""
    file = Path(source).resolve()
    return _changes(SourceChanges(file))


def _changes(watched: "SourceChanges") -> Iterator[bool]:
    while True:
        time.sleep(_POLL_S)
        yield watched.found()


class SourceChanges:
    """Watches a source and the files on which it depended when it was compiled last."""

    def __init__(self, source: Path) -> None:
        """Compare with the content at the time of this call."""
        self._place = _Place(source)
        self._changes = Changes(source, self._place.saved().dependencies)

    def found(self) -> bool:
        """Return whether the content has changed since the last call."""
        saved = self._place.saved()
        self._changes.watch(saved.dependencies, saved.fingerprint)
        return self._changes.found()

    @property
    def fingerprint(self) -> str:
        """A hash of the content at the last call of found()."""
        return self._changes.fingerprint


def _program(build_tree: Path | None) -> str:
    try:
        return program(build_tree)
    except rtcf.RtcfError as error:
        raise NotCompiledError(str(error)) from None
