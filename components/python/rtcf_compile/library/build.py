"""From compiled components to a library, by g++ and the flags that rtcf_add_components uses."""

import os
import re
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rtcf_compile.library import shim
from rtcf_compile.machine_code.lowering import Compiled
from rtcf_compile.source.mistake import Mistake

_HERE = Path(__file__).resolve().parent
_FLAGS = (
    *("-std=c++17", "-O2", "-g", "-DNDEBUG", "-fPIC", "-shared", "-fvisibility=hidden"),
    *("-fvisibility-inlines-hidden", "-fno-gnu-unique", "-Wl,--no-undefined"),
)


def compiler() -> list[str]:
    """Return the C++ compiler's command."""
    command = shlex.split(os.environ.get("CXX", "g++"))
    if shutil.which(command[0]) is None:
        raise Mistake(command[0], 0, "no such compiler", "sudo apt install g++, or set CXX")
    return command


def flags() -> list[str]:
    """Return flags of the component API: of the build tree that this runs in, or installed."""
    return shlex.split(os.environ.get("RTCF_CXXFLAGS", "-isystem /usr/include/eigen3"))


def library(compiled: Sequence[Compiled], output: Path) -> None:
    """Write the library of these components; raise Mistake if that fails."""
    with tempfile.TemporaryDirectory(prefix="rtcf-compile-") as name:
        folder = Path(name)
        objects = []
        for each in compiled:
            for number, content in enumerate(each.objects):
                file = folder / f"{each.description.name}_{number}.o"
                file.write_bytes(content)
                objects.append(str(file))
        (folder / "shim.cpp").write_text(shim.source(list(compiled)), encoding="utf-8")
        output.parent.mkdir(parents=True, exist_ok=True)
        # In one step, as the file may be that of a component which is loaded just now.
        part = output.with_name(f".{output.name}.{os.getpid()}")
        command = [*compiler(), *_FLAGS, f"-I{_HERE}", *flags(), str(folder / "shim.cpp")]
        command += [*objects, "-o", str(part), "-lm", *_libraries()]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            part.unlink(missing_ok=True)
            first = next((line for line in done.stderr.splitlines() if "error" in line), "")
            raise Mistake(
                compiled[0].file, 0, f"{command[0]}: {first or done.stderr[:300]}", _way_out(first)
            )
        part.replace(output)


def _libraries() -> list[str]:
    return shlex.split(os.environ.get("RTCF_LDFLAGS", "-lroscpp_serialization -lrostime -lfmt"))


def _way_out(line: str) -> str:
    message = re.search(r"error: ([a-z]\w*)/\w+\.h: No such file", line)
    if message:
        return f"sudo apt install lib{message[1].replace('_', '-')}-dev, or build {message[1]}"
    if "rtcf/component.hpp" in line or "No such file" in line:
        return "sudo apt install librtcf-dev"
    return "this is rtcf-compile's to mend: say so with the source"
