"""Compiles a Python source that is given instead of a package, compares the machine code with the
interpreter, and caches the library.
"""

import argparse
import hashlib
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sysconfig
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import rtcf
from rtcf_shared.folders import compiled_folder

_POLL_S = 0.2
_VERIFY = "1s"  # processor time of the comparison
_DIFFERENT = 3  # exit status of rtcf-compile if the comparison rejects the component
_VERIFIED = " verified"


class NotCompiledError(rtcf.RtcfError):
    """The source cannot be compiled; the message is one line."""


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


def compiled(
    source: str, build_tree: Path | None, progress: Callable[[str], None], verify: bool = True
) -> str:
    """Return the package of a source; compile it unless the cached library is up to date.

    Private daemons find the package.  With `verify`, the machine code of each version of the
    source is compared with the interpreter once.  Raises NotCompiledError.
    """
    file = Path(source).resolve()
    if not file.is_file():
        raise NotCompiledError(f"{source}: no such file")
    path_hash = hashlib.sha256(os.fsencode(file)).hexdigest()[:8]
    package = f"{_ros_name(file.stem)}_{path_hash}"
    library = compiled_folder() / package / f"{file.stem}.so"
    # The file of the fingerprint is beside the package's folder, which has only libraries.
    saved_file = compiled_folder() / f".{package}"
    current = fingerprint(file)
    saved = saved_file.read_text() if library.is_file() and saved_file.is_file() else ""
    if saved == current + _VERIFIED or (saved == current and not verify):
        return package
    progress(f"compiling {source}")
    options = ["--verify", _VERIFY] if verify else []
    if saved != current:
        options += ["-o", str(library)]
    done = subprocess.run(
        [_compiler(build_tree), source, *options], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        said = done.stderr.strip() or f"rtcf-compile ended with status {done.returncode}"
        if done.returncode == _DIFFERENT:
            said += f"; `rtcf-compile {source} --verify` shows details, --no-verify skips this"
        raise NotCompiledError(said.removeprefix("rtcf-compile: "))
    # rtcfd loads libraries only from folders without write permission for others; the umask may
    # permit more.
    for each in (library, library.parent, library.parents[1]):
        each.chmod(0o755)
    saved_file.write_text(current + (_VERIFIED if verify else ""))
    return package


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
    """Yield, every 0.2 s, whether the content of a source or of a Python file beside it has changed
    since the last time.  The first comparison is with the content at the time of this call, so
    that a change during a compilation is not missed."""
    file = Path(source).resolve()
    return _changes(file, fingerprint(file))


def _changes(file: Path, last: str) -> Iterator[bool]:
    while True:
        time.sleep(_POLL_S)
        now = fingerprint(file)
        yield now != last
        last = now


def fingerprint(source: Path) -> str:
    """Return a hash of everything that the compiled library depends on: the Python files in the
    source's folder, the compiler, and the runtime that is linked into each library.
    """
    # A compiled library links shared libraries whose names depend on the release of Debian.
    digest = hashlib.sha256(f"{rtcf.__version__} {_release()}\n".encode())
    compiler = importlib.util.find_spec("rtcf_compile")
    files = sorted(source.parent.glob("*.py"))
    if compiler is not None and compiler.origin is not None:
        folder = Path(compiler.origin).parent
        files += sorted(each for each in folder.rglob("*") if each.suffix in (".py", ".hpp"))
        digest.update(f"{_runtime(folder)}\n".encode())
    for file in files:
        try:
            content = file.read_bytes()
        except OSError:
            continue  # it is being saved
        digest.update(f"{file.name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


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


def _compiler(build_tree: Path | None) -> str:
    own = build_tree / "bin" / "rtcf-compile" if build_tree else Path("/usr/bin/rtcf-compile")
    found = str(own) if own.is_file() else shutil.which("rtcf-compile")
    if found is None:
        raise NotCompiledError("rtcf-compile not found: sudo apt install rtcf-python")
    return found


def _release() -> str:
    try:
        return platform.freedesktop_os_release().get("VERSION_ID", "")
    except OSError:
        return ""
