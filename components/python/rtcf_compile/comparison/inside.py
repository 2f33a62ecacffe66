"""Calls the machine code of a component in this process, for comparison and measurement."""

import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rtcf.component.declaration import REALTIME_HOOKS, Description, Member, own_field

from rtcf_compile.library.toolchain import compiler
from rtcf_compile.machine_code import port_access
from rtcf_compile.machine_code.compiled import Compiled
from rtcf_compile.machine_code.raises import hash_of
from rtcf_compile.source.mistake import Mistake

# Function of the runtime for ages. Records contain these values already.
_RUNTIME = f"""extern "C" {{
void {port_access.READ_MORE}(void*, void*, void*) {{}}
"""


class Inside:
    """The hooks of a compiled component, called on NumPy records."""

    def __init__(self, compiled: Compiled) -> None:
        """Load the objects as a library into this process; log calls do nothing."""
        self._compiled = compiled
        with tempfile.TemporaryDirectory(prefix="rtcf-verify-") as name:
            folder = Path(name)
            files = []
            for number, content in enumerate(compiled.objects):
                files.append(str(folder / f"{number}.o"))
                Path(files[-1]).write_bytes(content)
            symbols = [compiled.logs.symbol(each) for each in range(len(compiled.logs.calls))]
            logs = folder / "logs.cpp"
            logs.write_text(_RUNTIME + "".join(f"void {each}() {{}}\n" for each in symbols) + "}\n")
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
                raise Mistake(compiled.file, 0, done.stderr.strip()[:300], "check the C++ compiler")
            self._library = ctypes.CDLL(str(library))
        self._ports = _Ports(compiled.description)
        self._hooks = {}
        for hook in compiled.hooks:
            function = self._library[compiled.symbol(hook)]
            function.argtypes = [ctypes.c_void_p] * (2 if hook in REALTIME_HOOKS else 1)
            function.restype = ctypes.c_void_p
            self._hooks[hook] = function

    def call(self, hook: str, record: Any) -> str | None:
        """Run a hook on a record; return the text of its exception, as in the loop, or None.

        The hook reads inputs from the record and writes outputs to it.
        """
        if hook in REALTIME_HOOKS:
            self._ports.put(record)
            raised = self._hooks[hook](record.ctypes.data, self._ports.address)
            self._ports.take(record)
        else:
            raised = self._hooks[hook](record.ctypes.data)
        if not raised:
            return None
        line, values = (record[own_field(name)].tolist() for name in ("line", "raised"))
        return self._text(raised, line, values)

    def _text(self, raised: int, noted: int, values: list[int]) -> str:
        begin = ctypes.cast(raised, ctypes.POINTER(ctypes.c_void_p))[0]
        place = raised + ctypes.sizeof(ctypes.c_void_p)
        size = ctypes.cast(place, ctypes.POINTER(ctypes.c_int32))[0]
        meaning = self._compiled.raises.get(hash_of(ctypes.string_at(begin or 0, size)))
        if meaning is None:
            return f"{noted}: raised an unknown exception"
        text = meaning.text.format(*values) if meaning.has_values else meaning.text
        return f"{meaning.line or noted}: {text}"


class _Ports:
    """Ports of values without a loop, with the memory layout of port.hpp and slot.hpp."""

    def __init__(self, description: Description) -> None:
        self._inputs = [_Port(each) for each in port_access.inputs(description)]
        self._outputs = [_Port(each) for each in port_access.outputs(description)]
        self._now = np.ones(1, np.int64)
        for each in self._inputs:
            each.place[port_access.SOURCE // 8] = each.slot.ctypes.data
        for each in self._outputs:
            each.place[port_access.RAW // 8] = each.slot.ctypes.data
            each.place[port_access.NOW // 8] = self._now.ctypes.data
        ports = [each.place.ctypes.data for each in (*self._inputs, *self._outputs)]
        self._addresses = np.array(ports or [0], np.int64)
        self.address: int = int(self._addresses.ctypes.data)

    def put(self, record: Any) -> None:
        """Set inputs to the values of a record."""
        for each in self._inputs:
            is_new, is_valid = (bool(record[f"{each.name}__{flag}"]) for flag in ("new", "valid"))
            each.stamp = int(is_new) + int(is_valid)
            each.place[port_access.SEEN // 8] = each.stamp - is_new
            each.value = record[each.name]

    def take(self, record: Any) -> None:
        """Copy the values of written outputs to a record."""
        for each in self._outputs:
            if each.stamp:
                record[each.name] = each.value
                record[f"{each.name}__written"] = True
                each.stamp = 0


class _Port:
    """A port and its slot."""

    def __init__(self, member: Member) -> None:
        self.name = member.name
        self.place = np.zeros(4, np.int64)
        self._type = member.type
        self._begin = port_access.slot_value(member)
        size = self._begin + member.type.count * member.type.scalar.itemsize
        self.slot = np.zeros((size + 7) // 8, np.int64)

    @property
    def stamp(self) -> int:
        """The time of the last write; 0 = never written."""
        return int(self.slot[port_access.STAMP // 8])

    @stamp.setter
    def stamp(self, time: int) -> None:
        self.slot[port_access.STAMP // 8] = time

    @property
    def value(self) -> Any:
        """The value, in the element order of a record."""
        order = "F" if self._type.is_float else "C"
        return self._elements().reshape(self._type.shape, order=order)

    @value.setter
    def value(self, value: Any) -> None:
        self._elements()[:] = np.asarray(value).ravel("F" if self._type.is_float else "C")

    def _elements(self) -> Any:
        """Return the elements in the order of the slot: matrices of floats by columns."""
        memory = self.slot.view(np.uint8)[self._begin :]
        used = self._type.count * self._type.scalar.itemsize
        return memory[:used].view(self._type.scalar)
