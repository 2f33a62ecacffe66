"""Compiles rewritten functions to an object file, with numba and LLVM.

Of numba's output, only the inner functions are kept. They are linked with the arena, inlined, and
emitted for any processor of the architecture (linking.py). The result needs neither the interpreter
nor numba's runtime.
"""

import inspect
import warnings
from types import CodeType, FunctionType
from typing import Any

import numba
from numba.core import errors
from rtcf.component import Component, describe
from rtcf.component.declaration import HOOKS, REALTIME_HOOKS
from rtcf.component.ros_name import class_name_error

import rtcf_compile.machine_code.complex_functions
import rtcf_compile.machine_code.einsum
import rtcf_compile.machine_code.int_ufuncs
import rtcf_compile.machine_code.math_functions
import rtcf_compile.machine_code.numpy_functions
import rtcf_compile.machine_code.objects
import rtcf_compile.machine_code.operators
import rtcf_compile.machine_code.overloads
import rtcf_compile.machine_code.signal_functions  # noqa: F401, registers the overloads
from rtcf_compile.machine_code import (
    arena,
    backend,
    explain,
    linking,
    numbers,
    source_lines,
    trial,
    type_errors,
)
from rtcf_compile.machine_code.cache import Cache
from rtcf_compile.machine_code.compiled import Compiled
from rtcf_compile.machine_code.function_cache import FunctionCache
from rtcf_compile.rewriting import log_calls
from rtcf_compile.rewriting.common_rewriting import ARENA
from rtcf_compile.rewriting.functions import Compiler, Functions
from rtcf_compile.source.mistake import Mistake, Mistakes

warnings.filterwarnings("ignore", category=errors.NumbaWarning)

_OPTIONS = {"boundscheck": True, "error_model": "python", **backend.NO_WRAPPERS}
_BESIDE = tuple(each for each in HOOKS if each not in REALTIME_HOOKS)


def compile_component(cls: type[Component], arena_bytes: int = ARENA) -> Compiled:
    """Compile a class; raise Mistake with all errors that are found, or DeclarationError."""
    if problem := class_name_error(cls.__name__):
        file, line = inspect.getsourcefile(cls) or "?", inspect.getsourcelines(cls)[1]
        what, _, remedy = problem.partition(": ")
        raise Mistake(file, line, f"{cls.__name__} {what}", remedy)
    description = describe(cls)
    record = numba.from_dtype(description.record)
    files = Cache(Cache.folder_of_user())
    narrow: set[CodeType] = set()
    before = -1
    # Repeat while this finds more functions that compute with narrow numbers: their results may be
    # narrow numbers in other functions.
    while len(narrow) > before:
        before = len(narrow)
        mistakes = Mistakes()
        compiler = _compiler(narrow, mistakes)
        functions = Functions(cls, description, compiler, frozenset(narrow))
        hooks = functions.hooks()
        log_calls.logs_are(functions.logs)
        kept = FunctionCache(files, functions.logs)
        made = {}
        for hook in hooks:
            with mistakes.collected():
                made[hook] = _inner(hooks[hook], record, compiler, mistakes, kept)
        if len(narrow) == before:
            mistakes.one_per_line()
            mistakes.report()
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
            linked = linking.linked(result, inner, allocator, files)
            result.raises |= linked.raises
            result.objects.append(linked.object_file)
    files.remove_old()
    return result


def _compiler(narrow: set[CodeType], mistakes: Mistakes) -> Compiler:
    """Return a compiler that adds functions computing with narrow numbers to `narrow`."""
    pipeline = numbers.compiler(narrow, mistakes)
    return numba.njit(pipeline_class=pipeline, **_OPTIONS)  # type: ignore[no-any-return]


def _inner(
    function: FunctionType,
    record: Any,
    compiler: Compiler,
    mistakes: Mistakes,
    functions: FunctionCache,
) -> tuple[str, str]:
    """Return the name of the inner function, and the assembly that contains it.

    Raise Mistake for an error that the compiler has not added to `mistakes`.
    """
    dispatcher = compiler(function)
    before = len(mistakes.found)
    try:
        with (
            backend.not_to_run(),
            source_lines.emitted(),
            type_errors.kept(),
            functions.used(),
        ):
            dispatcher.compile((record,))
            result = next(iter(dispatcher.overloads.values()))
    except numbers.Stop as stop:
        raise stop.mistake from None
    except Mistake:
        raise
    except Exception as error:  # numba's own errors, or any other failure in it
        if len(mistakes.found) > before:
            raise mistakes.found.pop() from error
        raise explain.mistake(error, function) from error
    return result.fndesc.mangled_name, backend.assembly_of(result.library)
