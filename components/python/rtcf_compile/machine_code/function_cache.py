"""Keeps functions that numba has compiled, from one run to the next.

Most of the time of a compilation goes into the helpers: a matrix product or an assignment takes
longer than the statements of a component. Their code depends only on the versions of rtcf, numba
and NumPy, and on the types of their arguments. The code of a method also depends on its source and
on all that it refers to. A function whose dependencies are not all known is compiled in each run.
"""

import json
import secrets
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from types import FunctionType
from typing import Any
from unittest import mock

from numba.core import bytecode, caching, compiler, types
from numba.core.base import BaseContext
from numba.core.dispatcher import Dispatcher
from numba.core.environment import Environment
from numba.core.funcdesc import PythonFunctionDescriptor
from numba.core.targetconfig import ConfigStack
from numba.core.typing import signature

from rtcf_compile.machine_code import backend, identity
from rtcf_compile.machine_code.cache import Cache
from rtcf_compile.machine_code.object_types import is_object, object_type
from rtcf_compile.rewriting.functions import WRITTEN_CODE
from rtcf_compile.rewriting.logs import Logs
from rtcf_compile.source.objects import meaning_of
from rtcf_compile.source.records import NAMED

_compile = Dispatcher.compile
_compile_part = BaseContext._compile_subroutine_no_cache
_from_function = bytecode.FunctionIdentity.from_function.__func__
_LENGTH = 4  # bytes of the length of the head
_ID_DIGITS = 15  # hexadecimal digits of the number in a function's name
_LOG = "rtcf_log_"
_MEMORY = types.MemInfoPointer(types.voidptr)
_SCALARS = {
    str(each): each
    for each in (*types.number_domain, types.boolean, types.none, _MEMORY)
    if not isinstance(each, types.Complex)
}


class FunctionCache:
    """The compiled functions of one component."""

    def __init__(self, cache: Cache, logs: Logs) -> None:
        """Keep functions in a cache of files.

        `logs`: the log calls of the component; compiling a call sets the types of its arguments.
        """
        self._cache, self._logs = cache, logs
        self._descriptions = identity.Descriptions()
        self._keys: dict[tuple[Any, ...], str | None] = {}

    @contextmanager
    def used(self) -> Iterator[None]:
        """Make numba read functions from the cache, and write those that it compiles.

        The names of the functions depend on their descriptions, not on the order in which they are
        compiled. So functions of different runs have different names, or the same code.
        """

        def compile_function(dispatcher: Any, types_of: Any) -> Any:
            if isinstance(dispatcher._cache, caching.NullCache):
                dispatcher._cache = _OfFunction(self, dispatcher)
            return _compile(dispatcher, types_of)

        def identify(cls: Any, function: Any) -> Any:
            found = _from_function(cls, function)
            self._name(found)
            return found

        def compile_part(
            context: Any, builder: Any, function: Any, kind: Any, **options: Any
        ) -> Any:
            key = self._part_key(context, function, kind, **options)
            result = key and self.read(key, kind.args, context)
            if result:
                context.active_code_library.add_linking_library(result.library)
                return result
            result = _compile_part(context, builder, function, kind, **options)
            if key:
                self.write(key, result)
            return result

        with (
            mock.patch.object(types.Record, "mangling_args", property(self._record_name)),
            mock.patch.object(BaseContext, "_compile_subroutine_no_cache", compile_part),
            mock.patch.object(Dispatcher, "compile", compile_function),
            mock.patch.object(bytecode.FunctionIdentity, "from_function", classmethod(identify)),
        ):
            yield

    def key(self, dispatcher: Any, types_of: tuple[Any, ...]) -> str | None:
        """Return the key of a function for types of arguments; None if it has no description."""
        place = (dispatcher, types_of)
        if place not in self._keys:
            try:
                flags = compiler.Flags()
                dispatcher.targetdescr.options.parse_as_flags(flags, dispatcher.targetoptions)
                described = self._descriptions.dispatcher(dispatcher)
                kinds = [self._descriptions.type(each) for each in types_of]
                # The name of a component is in the symbols of its log calls.
                name = self._logs.component if _is_own(dispatcher) else ""
                parts = (identity.versions(), name, described, flags.summary(), kinds)
                self._keys[place] = identity.hash_of(parts)
            except identity.UnknownError:
                self._keys[place] = None
        return self._keys[place]

    def _part_key(
        self, context: Any, function: FunctionType, kind: Any, locals: Any = None, flags: Any = None
    ) -> str | None:
        """Return the key of a function that numba calls in the code of an operation."""
        current = ConfigStack.top_or_none()
        try:
            described = self._descriptions.function(function)
            kinds = [self._descriptions.type(each) for each in (*kind.args, kind.return_type)]
        except identity.UnknownError:
            return None
        given = (flags or current).summary() if flags or current else ""
        model = type(context.error_model).__name__
        if locals:
            return None
        return identity.hash_of(
            ("part", identity.versions(), described, kinds, flags is None, given, model)
        )

    def read(self, key: str, types_of: tuple[Any, ...], context: Any) -> Any:
        """Return the result of a compilation; None if it is not in the cache."""
        data = self._cache.read(key)
        if data is None:
            return None
        try:
            end = _LENGTH + int.from_bytes(data[:_LENGTH], "big")
            head = json.loads(data[_LENGTH:end])
            result = _result(head, zlib.decompress(data[end:]), types_of, context)
        except (LookupError, ValueError, RuntimeError, zlib.error):
            return None  # not written by this program
        for number, kinds in head["logs"]:
            self._logs.calls[number].types = kinds
        return result

    def write(self, key: str, result: Any, function: FunctionType | None = None) -> None:
        """Write the result of a compilation, unless it needs more than its code.

        `function`: the function of a dispatcher, which may log.
        """
        needs_more = result.objectmode or result.lifted or result.reload_init
        if needs_more or result.library.has_dynamic_globals or _has_unknown_line(result):
            return
        try:
            head = _head(result)
        except identity.UnknownError:
            return
        logged = sorted(_logged(function, set())) if function else []
        head["logs"] = [(number, self._logs.calls[number].types) for number in logged]
        text = json.dumps(head).encode()
        code = zlib.compress(backend.bitcode(result.library), 1)
        self._cache.write(key, len(text).to_bytes(_LENGTH, "big") + text + code)

    def _record_name(self, record: Any) -> tuple[str, tuple[int]]:
        """Return the name of a record's type, which numba derives from the order of creation."""
        try:
            described = identity.hash_of(self._descriptions.type(record))
        except identity.UnknownError:
            described = secrets.token_hex()
        return "Record", (int(described[:_ID_DIGITS], 16),)

    def _name(self, function: Any) -> None:
        """Name a function after its description."""
        try:
            described = (identity.versions(), self._descriptions.function(function.func))
            number = int(identity.hash_of(described)[:_ID_DIGITS], 16)
        except identity.UnknownError:
            number = secrets.randbits(4 * _ID_DIGITS)
        function.unique_id = number
        function.unique_name = f"{function.func_qualname}${number}"


class _OfFunction(caching.NullCache):  # type: ignore[misc]
    """numba's interface to the cache of one function."""

    def __init__(self, functions: FunctionCache, dispatcher: Any) -> None:
        self._functions, self._dispatcher = functions, dispatcher

    def load_overload(self, types_of: Any, context: Any) -> Any:
        """Return the result for these types; None if it is not in the cache."""
        key = self._functions.key(self._dispatcher, tuple(types_of))
        return key and self._functions.read(key, tuple(types_of), context)

    def save_overload(self, types_of: Any, result: Any) -> None:
        """Write the result for these types."""
        key = self._functions.key(self._dispatcher, tuple(types_of))
        if key and not _is_narrow(self._dispatcher):
            self._functions.write(key, result, self._dispatcher.py_func)


def _is_own(dispatcher: Any) -> bool:
    return WRITTEN_CODE in vars(dispatcher.py_func)


def _is_narrow(dispatcher: Any) -> bool:
    """Tell whether narrow numbers were found, so that functions will be rewritten."""
    pipeline = dispatcher._compiler.pipeline_class
    return _is_own(dispatcher) and len(pipeline.narrow) > pipeline.known_narrow


def _has_unknown_line(result: Any) -> bool:
    """Tell whether code of an expression, which is kept without its line, may raise."""
    if "__numba_array_expr_" not in result.fndesc.qualname:
        return False
    variables = result.library._final_module.global_variables
    return any(each.name.startswith(".const.pickledata") for each in variables)


def _logged(function: FunctionType, seen: set[FunctionType]) -> Iterator[int]:
    """Yield the numbers of the log calls in a function and in the functions that it calls."""
    if function in seen or WRITTEN_CODE not in vars(function):
        return
    seen.add(function)
    for name in function.__code__.co_names:
        if name.startswith(_LOG) and name.removeprefix(_LOG).isdigit():
            yield int(name.removeprefix(_LOG))
        called = function.__globals__.get(name)
        if isinstance(called, Dispatcher):
            yield from _logged(called.py_func, seen)


def _head(result: Any) -> dict[str, Any]:
    function = result.fndesc
    return {
        "result": _encoded(result.signature.return_type),
        "module": function.modname,
        "name": function.qualname,
        "unique_name": function.unique_name,
        "arguments": list(function.args),
        "noalias": function.noalias,
        "tags": list(function.abi_tags),
        "number": function.uid,
        "symbol": function.mangled_name,
        "library": result.library.name,
    }


def _result(head: dict[str, Any], code: bytes, types_of: tuple[Any, ...], context: Any) -> Any:
    """Return the result of a compilation, as numba's cache does."""
    returned = _decoded(head["result"])
    function = PythonFunctionDescriptor(
        True, head["module"], head["name"], head["unique_name"], "", None, returned, None,
        head["arguments"], (), argtypes=types_of, noalias=head["noalias"],
        abi_tags=tuple(head["tags"]), uid=head["number"], global_dict={},
    )  # fmt: skip
    if function.mangled_name != head["symbol"]:
        raise ValueError
    library = context.codegen().unserialize_library((head["library"], "bitcode", code))
    # Nothing runs the function: its environment is empty.
    environment = Environment({})
    environment.env_name = function.env_name
    return compiler.compile_result(
        typing_context=context.typing_context,
        target_context=context,
        entry_point=context.get_executable(library, function, environment),
        signature=signature(returned, *types_of),
        objectmode=False,
        lifted=(),
        fndesc=function,
        library=library,
        environment=environment,
        reload_init=[],
        referenced_envs=[],
    )


def _encoded(kind: Any) -> list[Any]:
    """Return the type of a result as JSON; raise UnknownError for other types."""
    cls = type(kind)
    if str(kind) in _SCALARS and kind == _SCALARS[str(kind)]:
        return ["scalar", str(kind)]
    if cls is types.Array:
        dtype = _encoded(kind.dtype)
        return ["array", dtype, kind.ndim, kind.layout, not kind.mutable, kind.aligned]
    if cls in (types.Tuple, types.UniTuple):
        return ["tuple", [_encoded(each) for each in kind.types]]
    if is_object(kind):
        fields = [_encoded(each) for each in kind.types]
        return ["object", meaning_of(kind.record, ""), fields, sorted(kind.small)]
    if cls is types.Optional:
        return ["optional", _encoded(kind.type)]
    if cls is types.SliceType:
        return ["slice", kind.members]
    raise identity.UnknownError(f"{kind}")


def _decoded(form: list[Any]) -> Any:
    kind, *parts = form
    if kind == "scalar":
        return _SCALARS[parts[0]]
    if kind == "array":
        dtype, dimensions, layout, readonly, aligned = parts
        return types.Array(_decoded(dtype), dimensions, layout, readonly, aligned=aligned)
    if kind == "tuple":
        return types.Tuple([_decoded(each) for each in parts[0]])
    if kind == "object":
        fields = [_decoded(each) for each in parts[1]]
        return object_type(NAMED[parts[0]].record, fields, parts[2])
    if kind == "optional":
        return types.Optional(_decoded(parts[0]))
    return types.slice2_type if parts[0] == 2 else types.slice3_type
