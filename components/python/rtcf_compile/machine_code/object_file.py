"""Compiles rewritten functions to an object file, with numba and LLVM.

Of numba's output, only the inner functions are kept. They are linked with the arena, inlined, and
emitted for any processor of the architecture. The result needs neither the interpreter nor numba's
runtime.
"""

import inspect
import re
import warnings
from dataclasses import dataclass, field
from types import CodeType, FunctionType
from typing import Any

import numba
from numba.core import errors
from rtcf.component import Component, describe
from rtcf.component.declaration import HOOKS, REALTIME_HOOKS, Description
from rtcf.component.ros_name import class_name_error

import rtcf_compile.machine_code.complex_functions
import rtcf_compile.machine_code.int_ufuncs
import rtcf_compile.machine_code.numpy_functions
import rtcf_compile.machine_code.operators
import rtcf_compile.machine_code.overloads  # noqa: F401, registers the overloads
from rtcf_compile.machine_code import (
    arena,
    backend,
    explain,
    gate,
    numbers,
    port_access,
    raised_values,
    source_lines,
    stack,
    trial,
)
from rtcf_compile.machine_code.raises import Raise, raises_in
from rtcf_compile.rewriting import log_calls
from rtcf_compile.rewriting.common_rewriting import ARENA
from rtcf_compile.rewriting.functions import Compiler, Functions
from rtcf_compile.rewriting.logs import Logs
from rtcf_compile.source.mistake import Mistake

warnings.filterwarnings("ignore", category=errors.NumbaWarning)

_NRT_COUNTS = re.compile(
    r"^define [^\n]*@NRT_(?:incref|decref)\([^\n]*\{\n.*?^\}\n"
    r"|^declare [^\n]*@NRT_(?:incref|decref)\([^\n]*\n",
    re.M | re.S,
)
_ADDRESS = re.compile(r"(?<=_)0x[0-9a-f]{6,}|(?<=\.)\d{9,}")
_COUNTS = "declare void @NRT_incref(i8*)\ndeclare void @NRT_decref(i8*)\n"
_OPTIONS = {"boundscheck": True, "error_model": "python", **backend.NO_WRAPPERS}
_BESIDE = tuple(each for each in HOOKS if each not in REALTIME_HOOKS)


@dataclass
class Compiled:
    """A component class as machine code."""

    description: Description
    file: str
    objects: list[bytes]
    hooks: list[str]
    logs: Logs
    used: set[str]
    lines: set[int]
    raises: dict[int, Raise] = field(default_factory=dict)
    line: int = 0  # the line of update
    other_calls: list[tuple[str, int, str, str]] = field(default_factory=list)
    narrow: set[CodeType] = field(default_factory=set)  # see Functions

    def symbol(self, hook: str) -> str:
        """Return the symbol of a hook."""
        return f"rtcf_{self.description.name}_{hook}"


def compile_component(cls: type[Component], arena_bytes: int = ARENA) -> Compiled:
    """Compile a class; raise Mistake on error."""
    if problem := class_name_error(cls.__name__):
        file, line = inspect.getsourcefile(cls) or "?", inspect.getsourcelines(cls)[1]
        what, _, remedy = problem.partition(": ")
        raise Mistake(file, line, f"{cls.__name__} {what}", remedy)
    description = describe(cls)
    record = numba.from_dtype(description.record)
    narrow: set[CodeType] = set()
    before = -1
    # Repeat while this finds more functions that compute with narrow numbers: their results may be
    # narrow numbers in other functions.
    while len(narrow) > before:
        before = len(narrow)
        compiler = _compiler(narrow)
        functions = Functions(cls, description, compiler, frozenset(narrow))
        hooks = functions.hooks()
        log_calls.logs_are(functions.logs)
        try:
            made = {hook: _inner(hooks[hook], record, compiler) for hook in hooks}
        except Mistake:
            if len(narrow) == before:
                raise
    result = Compiled(
        description,
        functions.file(),
        [],
        list(hooks),
        functions.logs,
        functions.used,
        functions.lines,
        line=functions.line(),
        other_calls=functions.other_calls,
        narrow=narrow,
    )
    trial.run(cls, functions.file())
    for thread, allocator in ((REALTIME_HOOKS, arena.arena(arena_bytes)), (_BESIDE, arena.heap())):
        inner = {hook: made[hook] for hook in thread if hook in made}
        if inner:
            module = _linked(result, inner, allocator)
            result.raises |= raises_in(str(module), functions.file())
            gate.check(module, result, inner, realtime=thread is REALTIME_HOOKS)
            result.objects.append(backend.machine().emit_object(module))
    return result


def _compiler(narrow: set[CodeType]) -> Compiler:
    """Return a compiler that adds functions computing with narrow numbers to `narrow`."""
    return numba.njit(pipeline_class=numbers.compiler(narrow), **_OPTIONS)  # type: ignore[no-any-return]


def _inner(function: FunctionType, record: Any, compiler: Compiler) -> tuple[str, str]:
    """Return the name of the inner function, and the assembly that contains it."""
    dispatcher = compiler(function)
    try:
        with backend.not_to_run(), source_lines.emitted():
            dispatcher.compile((record,))
            result = next(iter(dispatcher.overloads.values()))
    except numbers.Stop as stop:
        raise stop.mistake from None
    except Mistake:
        raise
    except Exception as error:  # numba's own errors, or any other failure in it
        raise explain.mistake(error, function) from error
    return result.fndesc.mangled_name, backend.assembly_of(result.library)


def _linked(compiled: Compiled, inner: dict[str, tuple[str, str]], allocator: str) -> Any:
    """Return one module with the entries of these hooks and only the code that they need."""
    parts, base = [], arena.DECLARATIONS + port_access.DECLARATIONS
    access = port_access.PortAccess(compiled.description, compiled.used)
    for hook, (name, text) in inner.items():
        base += port_access.entry(
            compiled.symbol(hook),
            name,
            backend.taken(text, name),
            access,
            has_ports=hook in REALTIME_HOOKS,
            writes_always=hook == "safe",
        )
        # Replace numba's reference counting, which uses atomic instructions.
        text = _NRT_COUNTS.sub("", text) + backend.pointers(_COUNTS)
        part = backend.parsed(text)
        _keep(part, {name})
        parts.append(part)
    symbols = {compiled.symbol(hook) for hook in inner}
    module = backend.parsed(backend.pointers(base))
    for part in parts:
        module.link_in(part)
    _keep(module, symbols)
    backend.inline(module)
    text = stack.promoted(str(module))
    for hook in inner:
        text = source_lines.entered(text, compiled.symbol(hook))
    module = backend.parsed(source_lines.unwound(text))
    module.link_in(backend.parsed(backend.pointers(allocator)))
    _keep(module, symbols)
    for variable in module.global_variables:
        if variable.name == raised_values.NAME:
            variable.linkage = "internal"  # each object has its own copy
    backend.optimise(module)
    _without_addresses(module)
    module.verify()
    return module


def _keep(module: Any, names: set[str]) -> None:
    """Drop code that these functions do not need."""
    for function in module.functions:
        if not function.is_declaration:
            function.linkage = "external" if function.name in names else "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    backend.drop_unused(module)


def _without_addresses(module: Any) -> None:
    """Remove addresses from numba's symbols, for reproducible libraries."""
    for each in (*module.functions, *module.global_variables):
        if not each.is_declaration and (plain := _ADDRESS.sub("0", each.name)) != each.name:
            each.name = plain
