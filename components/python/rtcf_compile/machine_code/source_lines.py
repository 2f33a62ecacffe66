"""Debug information: maps machine code to lines of the Python source.

Only functions of the user have lines. Code of numba and of the helpers belongs to the line that
calls it, as LLVM gives inlined code the line of the call. There is no information about variables,
so that the machine code is the same as without it. `strip` and dh_strip remove it.
"""

import copy
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

from llvmlite import ir
from numba.core import callconv, lowering

from rtcf_compile.rewriting.functions import WRITTEN_NAME
from rtcf_compile.source.prefix_map import mapped

_ERROR = 1  # linked modules must agree on the flag
_DWARF, _FORM = 4, 3


@contextmanager
def emitted() -> Iterator[None]:
    """Make numba emit line numbers, and mapped paths in exceptions."""
    raises = callconv.CPUCallConv.set_static_user_exc

    def init(lower: Any) -> None:
        written = vars(lower.func_ir.func_id.func).get(WRITTEN_NAME)
        if written is not None:
            lower.debuginfo = _Lines(lower, written)

    def raised(self: Any, *given: Any, loc: Any = None, **named: Any) -> Any:
        if loc is not None and mapped(loc.filename) != loc.filename:
            loc = copy.copy(loc)
            loc.filename = mapped(loc.filename)
        return raises(self, *given, loc=loc, **named)

    # BaseLower.init is an empty hook at the end of the constructor. numba's own debug information
    # would keep variables in memory.
    with (
        mock.patch.object(lowering.BaseLower, "init", init),
        mock.patch.object(callconv.CPUCallConv, "set_static_user_exc", raised),
    ):
        yield


def entered(assembly: str, symbol: str) -> str:
    """Return assembly in which the entry of a hook has the line scope of its inner function.

    Nothing changes if the inner function is not inlined into the entry.
    """
    entry = re.search(rf"^define [^\n]*@{re.escape(symbol)}\(.*?^\}}", assembly, re.M | re.S)
    assert entry is not None
    place = re.search(r"!dbg (!\d+)", entry[0])
    if place is None:
        return assembly
    number = place[1]
    while True:
        node = re.search(rf"^{number} = (?:distinct )?!DILocation\((.*)\)$", assembly, re.M)
        assert node is not None
        outer = re.search(r"inlinedAt: (!\d+)", node[1])
        if outer is None:
            break
        number = outer[1]
    scope = re.search(r"scope: (!\d+)", node[1])
    assert scope is not None
    head, brace, rest = entry[0].partition(" {\n")
    changed = f"{head} !dbg {scope[1]}{brace}{rest}"
    return assembly[: entry.start()] + changed + assembly[entry.end() :]


def unwound(assembly: str) -> str:
    """Return assembly whose functions have unwind tables, as in C++."""
    return re.sub(r"^(define .*?)((?: !dbg !\d+)? \{)$", r"\1 uwtable\2", assembly, flags=re.M)


class _Lines:
    """Emits the lines of one function; implements the interface of numba's lowering."""

    def __init__(self, lower: Any, written: str) -> None:
        self._lower, self._written = lower, written
        self._file = lower.func_ir.loc.filename
        self._module = lower.module
        self._scope: Any = None

    def mark_subprogram(self, function: Any, line: int, **_: Any) -> None:
        """Begin a function."""
        add = self._module.add_debug_info
        path = mapped(os.path.abspath(self._file))
        folder = os.path.dirname(path) if path.startswith("/") else "."
        file = add("DIFile", {"directory": folder, "filename": path})
        self._unit = add(
            "DICompileUnit",
            {
                "language": ir.DIToken("DW_LANG_C99"),
                "file": file,
                "producer": "rtcf-compile",
                "runtimeVersion": 0,
                "isOptimized": True,
                "emissionKind": ir.DIToken("FullDebug"),
                "nameTableKind": ir.DIToken("None"),
            },
            is_distinct=True,
        )
        kind = add("DISubroutineType", {"types": self._module.add_metadata([])})
        self._scope = add(
            "DISubprogram",
            {
                "name": self._written,
                "scope": file,
                "file": file,
                "line": line,
                "type": kind,
                "isLocal": True,
                "isDefinition": True,
                "scopeLine": line,
                "isOptimized": True,
                "unit": self._unit,
            },
            is_distinct=True,
        )
        function.set_metadata("dbg", self._scope)

    def mark_location(self, builder: Any, line: int) -> None:
        """Set the line of the instructions that follow."""
        place = self._lower.loc
        if getattr(place, "filename", None) != self._file:
            line = self._lower.func_ir.loc.line  # code of a function that numba has inlined
        builder.debug_metadata = self._module.add_debug_info(
            "DILocation", {"line": line, "column": 1, "scope": self._scope}
        )

    def mark_variable(self, *_: Any, **__: Any) -> None:
        """Emit nothing for variables."""

    def initialize(self) -> None:
        """Prepare nothing before the function exists."""

    def finalize(self) -> None:
        """Add the compile unit to the module after its functions."""
        self._named("llvm.dbg.cu").add(self._unit)
        flags = self._named("llvm.module.flags")
        for flag, value in (("Dwarf Version", _DWARF), ("Debug Info Version", _FORM)):
            number = [ir.IntType(32)(each) for each in (_ERROR, value)]
            flags.add(self._module.add_metadata([number[0], flag, number[1]]))

    def _named(self, metadata: str) -> Any:
        if metadata in self._module.namedmetadata:
            return self._module.get_named_metadata(metadata)
        return self._module.add_named_metadata(metadata)
