"""Links compiled components to a library: their objects, their tables, the adapters of their
messages, and the precompiled runtime.
"""

import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rtcf_compile.library import messages, tables, toolchain
from rtcf_compile.machine_code.compiled import Compiled

_FLAGS = (
    *("-shared", "-Wl,--no-undefined", "-Wl,-Bsymbolic-functions", "-Wl,--gc-sections"),
    "-Wl,--as-needed",
)


def library(compiled: Sequence[Compiled], output: Path) -> None:
    """Write a library of these components; raise Mistake on failure."""
    runtime = toolchain.runtime()
    with tempfile.TemporaryDirectory(prefix="rtcf-compile-") as name:
        folder = Path(name)
        objects = []
        for each in compiled:
            for number, content in enumerate(each.objects):
                objects.append(folder / f"{each.description.name}_{number}.o")
                objects[-1].write_bytes(content)
        objects.append(folder / "tables.o")
        objects[-1].write_bytes(tables.object_file(compiled))
        members = [member for each in compiled for member in each.description.members.values()]
        used = [member.message for member in members if member.message]
        objects += messages.objects(used, folder)
        output.parent.mkdir(parents=True, exist_ok=True)
        # Replace the file atomically: an executor may be loading it.
        part = output.with_name(f".{output.name}.{os.getpid()}")
        command = [*toolchain.compiler(), *_FLAGS, *map(str, objects), str(runtime)]
        command += ["-o", str(part), *toolchain.libraries(), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            part.unlink(missing_ok=True)
            raise toolchain.mistake(compiled[0].file, done.stderr)
        part.replace(output)
