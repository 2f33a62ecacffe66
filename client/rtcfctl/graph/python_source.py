"""A Python source in the place of a package: compiled, compared with the interpreter, and kept for
the next time.
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
from pathlib import Path

import rtcf
from rtcf_shared.folders import compiled_folder

_LOOK_S = 0.2
_VERIFY = "1s"  # of processor time
_DIFFERENT = 3  # exit status of rtcf-compile
_VERIFIED = " verified"


class NotCompiledError(rtcf.RtcfError):
    """A source that cannot be compiled; the text is one line."""


def is_one(package: str) -> bool:
    """Tell whether what stands in the place of a package is a Python source."""
    return package.endswith(".py")


def add_option(to: argparse.ArgumentParser) -> None:
    """Add --no-verify."""
    to.add_argument(
        "--no-verify",
        action="store_true",
        help="of a Python source: do not compare the machine code with the interpreter",
    )


def compiled(
    source: str, build_tree: Path | None, progress: Callable[[str], None], verify: bool = True
) -> str:
    """Return the package of a source, which private daemons find; compile it if it is new.

    With `verify`, the machine code of each source is compared with the interpreter once.
    """
    file = Path(source).resolve()
    if not file.is_file():
        raise NotCompiledError(f"{source}: no such file")
    place = hashlib.sha256(os.fsencode(file)).hexdigest()[:8]
    package = f"{_ros_name(file.stem)}_{place}"
    library = compiled_folder() / package / f"{file.stem}.so"
    # Beside the package, not in it: only libraries belong there.
    known = compiled_folder() / f".{package}"
    print_of_it = fingerprint(file)
    kept = known.read_text() if library.is_file() and known.is_file() else ""
    if kept == print_of_it + _VERIFIED or (kept == print_of_it and not verify):
        return package
    progress(f"compiling {source}")
    options = ["--verify", _VERIFY] if verify else []
    if kept != print_of_it:
        options += ["-o", str(library)]
    done = subprocess.run(
        [_compiler(build_tree), source, *options], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        said = done.stderr.strip() or f"rtcf-compile ended with status {done.returncode}"
        if done.returncode == _DIFFERENT:
            said += f"; `rtcf-compile {source} --verify` shows more, --no-verify takes it as it is"
        raise NotCompiledError(said.removeprefix("rtcf-compile: "))
    # rtcfd takes libraries only where others cannot write, whatever our umask is.
    for each in (library, library.parent, library.parents[1]):
        each.chmod(0o755)
    known.write_text(print_of_it + (_VERIFIED if verify else ""))
    return package


def _ros_name(stem: str) -> str:
    """Return the beginning of a package's name, of which 64 characters are allowed."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)[:48]
    return name if name[:1].isalpha() else f"source_{name}"


def looks(source: str) -> Iterator[bool]:
    """Yield again and again whether a source, or a Python file beside it, has been saved with other
    content since the last time; of what is saved from this call on nothing is missed, while the
    source is compiled for instance."""
    file = Path(source).resolve()
    return _changes(file, fingerprint(file))


def _changes(file: Path, last: str) -> Iterator[bool]:
    while True:
        time.sleep(_LOOK_S)
        now = fingerprint(file)
        yield now != last
        last = now


def fingerprint(source: Path) -> str:
    """Return what a library of it depends on, as a hash: files beside it, the compiler's, and the
    runtime that is in each library.
    """
    # Libraries that it needs have other names in another release of Debian.
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
            continue  # just being saved
        digest.update(f"{file.name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def _runtime(compiler: Path) -> str:
    """Return what distinguishes the runtime beside a compiler: of a build tree, or installed."""
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
        raise NotCompiledError("no rtcf-compile to compile it: sudo apt install rtcf-python")
    return found


def _release() -> str:
    try:
        return platform.freedesktop_os_release().get("VERSION_ID", "")
    except OSError:
        return ""
