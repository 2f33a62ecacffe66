"""g++ and the flags and runtime of the component API, from the current build tree or from the
system.
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
    """Return the command of the C++ compiler."""
    command = shlex.split(os.environ.get("CXX", "g++"))
    if shutil.which(command[0]) is None:
        raise Mistake(command[0], 0, "no such compiler", "sudo apt install g++, or set CXX")
    return command


def flags() -> list[str]:
    """Return the compiler flags for headers."""
    return shlex.split(os.environ.get("RTCF_CXXFLAGS", "-isystem /usr/include/eigen3"))


def libraries() -> list[str]:
    """Return the linker flags for libraries."""
    return shlex.split(os.environ.get("RTCF_LDFLAGS", "-lroscpp_serialization -lrostime -lfmt"))


def runtime() -> Path:
    """Return the archive that each library contains; raise Mistake if it does not exist."""
    folder = Path("/usr/lib") / (sysconfig.get_config_var("MULTIARCH") or "")
    file = Path(os.environ.get("RTCF_PYTHON_RUNTIME") or folder / "librtcf_python.a")
    if not file.is_file():
        raise Mistake(str(file), 0, "does not exist", "sudo apt install librtcf-dev")
    return file


def header(name: str) -> Path | None:
    """Return the header that an #include would find, or None."""
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
    """Return a text that identifies this compiler and this runtime."""
    program = Path(shutil.which(compiler()[0]) or "").resolve()
    found = program.stat()
    content = hashlib.sha256(runtime().read_bytes()).hexdigest()
    return f"{program} {found.st_size} {found.st_mtime_ns} {content}"


def mistake(file: str, said: str) -> Mistake:
    """Return the output of a failed compiler or linker as a Mistake."""
    first = next((each for each in said.splitlines() if re.search("error|undefined", each)), "")
    remedy = "this is a bug of rtcf-compile: report it with the source"
    if "rtcf_python_library_" in said:
        remedy = "install the same version of librtcf-dev and rtcf-python"
    elif "ld returned" in first:
        remedy = "the linker has ended without a message: free space on the disk, or memory"
    elif "No such file" in first or "cannot find" in said:
        remedy = "sudo apt install librtcf-dev"
    return Mistake(file, 0, f"{compiler()[0]}: {(first or said.strip())[:300]}", remedy)


def _paths(variable: str) -> list[str]:
    return os.environ.get(variable, "").split(os.pathsep)
