"""g++, with the flags and the runtime of the component API: of the build tree that this runs in, or
installed.
"""

import hashlib
import os
import re
import shlex
import shutil
import sysconfig
from pathlib import Path

from rtcf_compile.source.mistake import Mistake

_SYSTEM = ("/usr/local/include", "/usr/include")


def compiler() -> list[str]:
    """Return the C++ compiler's command."""
    command = shlex.split(os.environ.get("CXX", "g++"))
    if shutil.which(command[0]) is None:
        raise Mistake(command[0], 0, "no such compiler", "sudo apt install g++, or set CXX")
    return command


def flags() -> list[str]:
    """Return the compiler's flags for headers."""
    return shlex.split(os.environ.get("RTCF_CXXFLAGS", "-isystem /usr/include/eigen3"))


def libraries() -> list[str]:
    """Return the linker's flags for libraries."""
    return shlex.split(os.environ.get("RTCF_LDFLAGS", "-lroscpp_serialization -lrostime -lfmt"))


def runtime() -> Path:
    """Return the archive that is in each library; raise Mistake if it is not there."""
    folder = Path("/usr/lib") / (sysconfig.get_config_var("MULTIARCH") or "")
    file = Path(os.environ.get("RTCF_PYTHON_RUNTIME") or folder / "librtcf_python.a")
    if not file.is_file():
        raise Mistake(str(file), 0, "is not there", "sudo apt install librtcf-dev")
    return file


def header(name: str) -> Path | None:
    """Return the header that an #include finds."""
    given = [each for flag in ("CPATH", "CPLUS_INCLUDE_PATH") for each in _paths(flag)]
    words = iter(flags())
    for word in words:
        if word in ("-I", "-isystem"):
            given.append(next(words, ""))
        elif word.startswith("-I"):
            given.append(word[2:])
    files = (Path(folder) / name for folder in (*given, *_SYSTEM) if folder)
    return next((each for each in files if each.is_file()), None)


def identity() -> str:
    """Return what distinguishes this compiler and this runtime from others."""
    program = Path(shutil.which(compiler()[0]) or "").resolve()
    found = program.stat()
    content = hashlib.sha256(runtime().read_bytes()).hexdigest()
    return f"{program} {found.st_size} {found.st_mtime_ns} {content}"


def mistake(file: str, said: str) -> Mistake:
    """Return what a compiler or a linker says as a mistake."""
    first = next((each for each in said.splitlines() if re.search("error|undefined", each)), "")
    way_out = "this is rtcf-compile's to mend: say so with the source"
    if "rtcf_python_library_" in said:
        way_out = "install librtcf-dev and rtcf-python of one version"
    elif "No such file" in first or "cannot find" in said:
        way_out = "sudo apt install librtcf-dev"
    return Mistake(file, 0, f"{compiler()[0]}: {(first or said.strip())[:300]}", way_out)


def _paths(variable: str) -> list[str]:
    return os.environ.get(variable, "").split(os.pathsep)
