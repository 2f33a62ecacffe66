"""Describes functions and types by their content, so that equal descriptions mean equal code.

The description of a function contains its code, with the numbers of its lines, and all that it
refers to: constants, enums, types, and the functions that it calls. Modules of rtcf, numba, NumPy
and Python do not change without their versions, so that names are enough there. What refers to
anything else has no description.
"""

import dis
import enum
import hashlib
import os
import re
import struct
import sys
import sysconfig
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite.binding
import numba
import numpy as np
import rtcf
from numba.core import config, dispatcher, types
from numba.core.compiler import Compiler, CompilerBase
from numba.extending import _Intrinsic

import rtcf_compile
from rtcf_compile.machine_code.object_types import MarkerType, UnknownType, is_object
from rtcf_compile.rewriting.functions import HELPERS, INT_BOUNDS, WRITTEN_NAME
from rtcf_compile.source.records import Arranged, Meaning, Object, Unknown

_PLAIN = (type(None), bool, int, str, bytes, type(...))
_FOLDERS = tuple(
    f"{each}{os.sep}"
    for each in (
        *(Path(each.__file__).resolve().parent for each in (numba, np, rtcf, rtcf_compile)),
        sysconfig.get_path("stdlib"),
    )
)
# Types whose names tell them from each other.
_NAMED_TYPES = (
    *(types.Integer, types.Float, types.Boolean, types.NoneType, types.EllipsisType),
    *(types.UnicodeType, types.RangeType, types.MemInfoPointer),
)
_TUPLES = (types.Tuple, types.UniTuple, types.StarArgTuple, types.StarArgUniTuple)
# In names that numba makes. What they refer to is described in the order of its use.
_ADDRESS = re.compile(r"(?<=^__numba_array_expr_)_?0x\w+$|(?<=^__ufunc_or_dufunc_)_?0x\w+$")
_LITERALS = (
    *(types.IntegerLiteral, types.StringLiteral, types.BooleanLiteral, types.SliceLiteral),
)


def is_array_expression(code: CodeType) -> bool:
    """Tell whether numba has made a function of an expression of arrays, for each element."""
    return code.co_name.startswith("__numba_array_expr_")


class OwnCompiler(CompilerBase):  # type: ignore[misc]
    """Base class of numba's compiler for functions of the user."""


class UnknownError(Exception):
    """An object has no description."""


def hash_of(description: object) -> str:
    """Return the hash of a description, or of a tuple of descriptions and texts."""
    return hashlib.sha256(repr(description).encode()).hexdigest()


@cache
def versions() -> str:
    """Return a hash of the compiler itself: the versions of its parts, and its options."""
    parts: list[object] = [sys.version, sysconfig.get_platform(), rtcf.__version__]
    for module in (numba, llvmlite, np):
        parts.append((module.__name__, module.__version__))
    # Packages of a distribution may have patches that do not change the version.
    libraries = Path(llvmlite.binding.__file__).parent.glob("*.so")
    for file in (*map(Path, (numba.__file__, dispatcher.__file__, np.__file__)), *libraries):
        found = file.stat()
        parts.append((str(file), found.st_size, found.st_mtime_ns))
    parts += sorted(
        (name, repr(value))
        for name, value in vars(config).items()
        if name.isupper() and not callable(value)
    )
    library = Path(rtcf.__file__).parent
    sources = [*Path(rtcf_compile.__file__).parent.rglob("*.py"), library / "linear.py"]
    for source in sorted([*sources, *(library / "component").rglob("*.py")]):
        parts.append((str(source), hashlib.sha256(source.read_bytes()).hexdigest()))
    # The paths in exceptions, see prefix_map.py.
    parts.append(os.environ.get("CXXFLAGS", ""))
    return hash_of(parts)


class Descriptions:
    """The descriptions of functions, made once."""

    def __init__(self) -> None:
        """Begin with none."""
        self._known: dict[FunctionType, str] = {}
        self._current: list[FunctionType] = []

    def function(self, function: FunctionType) -> str:
        """Return the description of a function, with all that it refers to."""
        if function in self._known:
            return self._known[function]
        if _is_named(function):
            return f"{function.__module__}.{function.__qualname__}"
        if function in self._current:
            return f"again {self._current.index(function)}"
        self._current.append(function)
        try:
            description = hash_of(self._parts(function))
        finally:
            self._current.pop()
        if not self._current:  # else it may refer to the functions around it
            self._known[function] = description
        return description

    def type(self, kind: Any) -> object:
        """Return the description of a numba type."""
        cls, name = type(kind), type(kind).__name__
        if cls in _NAMED_TYPES:
            return name, str(kind)
        if cls is types.Array:
            layout = kind.ndim, kind.layout, kind.mutable, kind.aligned
            return name, self.type(kind.dtype), layout
        if cls is types.NestedArray:
            return name, self.type(kind.dtype), tuple(map(int, kind.shape))
        if is_object(kind):
            fields = [self.type(each) for each in kind.types]
            return name, kind.record.description(), fields, sorted(kind.small)
        if cls is MarkerType:
            return name, self.of(kind.marker)
        if cls is UnknownType:
            return name, str(kind)
        if cls in _TUPLES:
            return name, [self.type(each) for each in kind.types]
        if cls is types.Optional:
            return name, self.type(kind.type)
        if cls is types.CPointer:
            return name, self.type(kind.dtype)
        if cls is types.SliceType:
            return name, kind.members
        if cls in _LITERALS:
            return name, repr(kind.literal_value)
        if cls is types.Omitted:
            return name, self.of(kind.value)
        if cls is types.DType:
            return name, self.type(kind.dtype)
        if cls is types.NumberClass:
            return name, self.type(kind.instance_type)
        if cls is types.TypeRef:
            return name, self.of(kind.instance_type)
        if cls is types.Record:
            fields = [
                (field, self.type(each.type), each.offset, each.alignment)
                for field, each in kind.fields.items()
            ]
            return name, fields, kind.size, kind.aligned
        if cls in (types.IntEnumClass, types.IntEnumMember, types.EnumClass, types.EnumMember):
            return name, self.of(kind.instance_class), self.type(kind.dtype)
        if cls is types.Function:
            return name, self.of(kind.typing_key)
        if cls is types.Dispatcher:
            return name, self.of(kind.dispatcher)
        raise UnknownError(f"{kind}")

    def of(self, value: Any) -> object:
        """Return the description of a value that a function refers to."""
        cls = type(value)
        if cls in _PLAIN:
            return cls.__name__, repr(value)
        if cls is float:
            return "float", struct.pack(">d", value)
        if cls is complex:
            return "complex", struct.pack(">dd", value.real, value.imag)
        if isinstance(value, types.Type):
            return self.type(value)
        if cls is Arranged:
            return "class", value.record.description(), value.places, value.small
        if cls is Meaning:
            return "attribute", value.record.description(), value.attribute
        if cls is Object:
            return "object", value.record.description(), [self.of(each) for each in value]
        if cls is Unknown:
            return "unknown", value.cls.__qualname__
        if cls in (tuple, list):
            return cls.__name__, [self.of(each) for each in value]
        if cls is frozenset:
            return cls.__name__, sorted(repr(self.of(each)) for each in value)
        if cls is dict:
            return cls.__name__, [(self.of(key), self.of(each)) for key, each in value.items()]
        if cls is FunctionType:
            return self.function(value)
        if cls is CodeType:
            return self._code(value)
        if isinstance(value, dispatcher.Dispatcher):
            return self.dispatcher(value)
        if cls is _Intrinsic:
            return "intrinsic", value._name, self.of(value._defn)
        if cls is np.ndarray and value.dtype.kind in "fiub":
            layout = value.shape, value.strides, value.flags.num, value.flags.writeable
            return "array", value.dtype.str, layout, value.tobytes()
        if isinstance(value, np.number | np.bool_):
            return cls.__name__, value.tobytes()
        if isinstance(value, np.dtype) and value.kind in "fiub":
            return "dtype", value.str
        if cls is ModuleType and _is_fixed(value.__name__):
            return "module", value.__name__
        if isinstance(value, np.ufunc) and getattr(np, value.__name__, None) is value:
            return "ufunc", value.__name__
        if isinstance(value, enum.Enum):
            return "member", self.of(cls), value.name
        if isinstance(value, type) and issubclass(value, enum.Enum):
            members = [(each, member.value) for each, member in value.__members__.items()]
            bases = [each.__qualname__ for each in value.__mro__]
            return "enum", value.__module__, value.__qualname__, bases, members
        if callable(value) and _is_named(value):
            return "named", value.__module__, value.__qualname__
        raise UnknownError(f"{cls.__name__} {value!r:.80}")

    def dispatcher(self, compiled: Any) -> object:
        """Return the description of a function that numba compiles."""
        kind = getattr(compiled, "_impl_kind", "direct")
        pipeline = compiled._compiler.pipeline_class
        is_own = issubclass(pipeline, OwnCompiler)
        if kind != "direct" or (pipeline is not Compiler and not is_own):
            raise UnknownError("another compiler")
        options = sorted((name, self.of(each)) for name, each in compiled.targetoptions.items())
        described = self.function(compiled.py_func)
        return "dispatcher", is_own, described, options, self.of(compiled.locals)

    def _parts(self, function: FunctionType) -> list[object]:
        """Return the descriptions of the parts of a function."""
        parts: list[object] = [
            function.__module__,
            _ADDRESS.sub("", function.__qualname__),
            vars(function).get(WRITTEN_NAME),
            sorted(vars(function).get(INT_BOUNDS, {}).items()),
            self._code(function.__code__),
            self.of(function.__defaults__),
            self.of(function.__kwdefaults__),
        ]
        for cell in function.__closure__ or ():
            parts.append(self.of(cell.cell_contents))
        if not _has_fixed_globals(function):
            for name in dict.fromkeys(_globals(function.__code__)):
                if name in function.__globals__:
                    parts.append((_ADDRESS.sub("", name), self._global(name, function)))
        return parts

    def _global(self, name: str, function: FunctionType) -> object:
        value = function.__globals__[name]
        return "helper" if HELPERS.get(name, self) is value else self.of(value)

    def _code(self, code: CodeType) -> object:
        constants = [self.of(each) for each in code.co_consts]
        lines: tuple[object, ...] = (code.co_filename, code.co_firstlineno, code.co_linetable)
        if is_array_expression(code):
            lines = ()
        names = [_ADDRESS.sub("", each) for each in (code.co_name, *code.co_names)]
        variables = code.co_varnames, code.co_freevars, code.co_cellvars, code.co_exceptiontable
        counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
        return code.co_code, constants, lines, names, variables, counts


def _is_named(value: Any) -> bool:
    """Tell whether a name in a module that does not change refers to a value."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not isinstance(module, str) or not isinstance(name, str) or not _is_fixed(module):
        return False
    found: Any = sys.modules[module]
    for part in name.split("."):
        found = getattr(found, part, None)
    return bool(found is value)


def _globals(code: CodeType) -> Iterator[str]:
    """Yield the names of the global variables in code."""
    for each in dis.get_instructions(code):
        if each.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            yield each.argval
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _globals(constant)


def _has_fixed_globals(function: FunctionType) -> bool:
    module = sys.modules.get(function.__module__ or "")
    if module is None or vars(module) is not function.__globals__:
        return False
    return _is_fixed(module.__name__)


def _is_fixed(name: str) -> bool:
    """Tell whether a module is a part of rtcf, numba, NumPy or Python."""
    module = sys.modules.get(name)
    if module is None:
        return False
    file = getattr(module, "__file__", None)
    if file is None:
        return name.partition(".")[0] in sys.builtin_module_names
    folder = os.path.realpath(file)
    is_other = "/dist-packages/" in folder or "/site-packages/" in folder
    own = _FOLDERS[:-1] if is_other else _FOLDERS
    return any(map(folder.startswith, own))
