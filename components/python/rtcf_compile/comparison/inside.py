"""A component's machine code called from here, without a loop: for comparison and measurement."""

import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from rtcf_compile.library.toolchain import compiler
from rtcf_compile.machine_code.lowering import Compiled
from rtcf_compile.machine_code.raises import hash_of
from rtcf_compile.source.mistake import Mistake


class Inside:
    """The hooks of a compiled component, on records of NumPy."""

    def __init__(self, compiled: Compiled) -> None:
        """Load the objects as a library of this process; log calls do nothing."""
        self._compiled = compiled
        with tempfile.TemporaryDirectory(prefix="rtcf-verify-") as name:
            folder = Path(name)
            files = []
            for number, content in enumerate(compiled.objects):
                files.append(str(folder / f"{number}.o"))
                Path(files[-1]).write_bytes(content)
            symbols = [compiled.logs.symbol(each) for each in range(len(compiled.logs.calls))]
            logs = folder / "logs.cpp"
            logs.write_text("".join(f'extern "C" void {each}() {{}}\n' for each in symbols))
            library = folder / "component.so"
            command = [
                *compiler(),
                "-shared",
                "-fPIC",
                str(logs),
                *files,
                "-o",
                str(library),
                "-lm",
            ]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise Mistake(compiled.file, 0, done.stderr.strip()[:300], "look at the compiler")
            self._library = ctypes.CDLL(str(library))
        self._hooks = {}
        for hook in compiled.hooks:
            function = self._library[compiled.symbol(hook)]
            function.argtypes, function.restype = [ctypes.c_void_p], ctypes.c_void_p
            self._hooks[hook] = function

    def call(self, hook: str, record: Any) -> str | None:
        """Run a hook on a record; return what it raised, as the loop would say it."""
        raised = self._hooks[hook](record.ctypes.data)
        if not raised:
            return None
        return self._text(raised, int(record["_line"]))

    def _text(self, raised: int, noted: int) -> str:
        begin = ctypes.cast(raised, ctypes.POINTER(ctypes.c_void_p))[0]
        place = raised + ctypes.sizeof(ctypes.c_void_p)
        size = ctypes.cast(place, ctypes.POINTER(ctypes.c_int32))[0]
        meaning = self._compiled.raises.get(hash_of(ctypes.string_at(begin or 0, size)))
        if meaning is None:
            return f"{noted}: raised an unknown exception"
        return f"{meaning.line or noted}: {meaning.text}"
