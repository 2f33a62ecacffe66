"""Links the hooks of one thread to an object file, with their entries and the allocator."""

import json
import re
from dataclasses import astuple, dataclass
from typing import Any

from rtcf.component.declaration import REALTIME_HOOKS

from rtcf_compile.machine_code import (
    arena,
    backend,
    gate,
    identity,
    port_access,
    raised_values,
    source_lines,
    stack,
    unrolling,
)
from rtcf_compile.machine_code.cache import Cache
from rtcf_compile.machine_code.compiled import Compiled
from rtcf_compile.machine_code.raises import Raise, raises_in

_NRT_COUNTS = re.compile(
    r"^define [^\n]*@NRT_(?:incref|decref)\([^\n]*\{\n.*?^\}\n"
    r"|^declare [^\n]*@NRT_(?:incref|decref)\([^\n]*\n",
    re.M | re.S,
)
# Addresses in numba's names, and the numbers that tell functions apart (function_cache.py).
_NUMBER = re.compile(r"(?<=_)0x[0-9a-f]{6,}|(?<=\.)\d{9,}|(?<=B)\d+v\d+(?=B\d)")
_COUNTS = "declare void @NRT_incref(i8*)\ndeclare void @NRT_decref(i8*)\n"
_DEEPEST = 2  # loops in each other that are unrolled
_LENGTH = 4  # bytes of the length of the head


@dataclass(frozen=True)
class Linked:
    """The hooks of a thread as an object file, and the exceptions in it."""

    object_file: bytes
    raises: dict[int, Raise]


def linked(
    compiled: Compiled, inner: dict[str, tuple[str, str]], allocator: str, cache: Cache
) -> Linked:
    """Link hooks; raise Mistake if they need a function that the loop does not have.

    `inner`: the name of the inner function of each hook, and the assembly that contains it. The
    result depends only on the text of the assembly, by which the cache keeps it.
    """
    texts = [_entries(compiled, inner)]
    texts += [_part(hook, name, text) for hook, (name, text) in inner.items()]
    key = identity.hash_of((identity.versions(), compiled.file, list(inner), texts, allocator))
    if (kept := _read(cache, key)) is not None:
        return kept
    module = _module(texts, {compiled.symbol(hook) for hook in inner}, allocator)
    raises = raises_in(str(module), compiled.file)
    gate.check(module, compiled, inner, realtime=set(inner) <= set(REALTIME_HOOKS))
    result = Linked(bytes(backend.machine().emit_object(module)), raises)
    head = json.dumps([(number, astuple(each)) for number, each in raises.items()]).encode()
    cache.write(key, len(head).to_bytes(_LENGTH, "big") + head + result.object_file)
    return result


def _read(cache: Cache, key: str) -> Linked | None:
    data = cache.read(key)
    if data is None:
        return None
    end = _LENGTH + int.from_bytes(data[:_LENGTH], "big")
    try:
        raises = {number: Raise(*each) for number, each in json.loads(data[_LENGTH:end])}
    except (ValueError, TypeError):
        return None  # not written by this program
    return Linked(data[end:], raises)


def _entries(compiled: Compiled, inner: dict[str, tuple[str, str]]) -> str:
    """Return the assembly of the entries of the hooks."""
    access = port_access.PortAccess(compiled.description, compiled.used)
    text = arena.DECLARATIONS + port_access.DECLARATIONS
    for hook, (name, assembly) in inner.items():
        text += port_access.entry(
            compiled.symbol(hook),
            _inner_name(hook),
            backend.taken(assembly, name),
            access,
            has_ports=hook in REALTIME_HOOKS,
            writes_always=hook == "safe",
        )
    return backend.pointers(text)


def _part(hook: str, name: str, assembly: str) -> str:
    """Return the assembly of a hook, without code that it does not need."""
    # Replace numba's reference counting, which uses atomic instructions.
    part = backend.parsed(_NRT_COUNTS.sub("", assembly) + backend.pointers(_COUNTS))
    _keep(part, {name})
    part.get_function(name).name = _inner_name(hook)
    _without_numbers(part)
    return str(part)


def _inner_name(hook: str) -> str:
    return f"rtcf_inner_{hook}"


def _module(texts: list[str], symbols: set[str], allocator: str) -> Any:
    """Return one module with only the code that the hooks need."""
    module = backend.parsed(texts[0])
    for text in texts[1:]:
        module.link_in(backend.parsed(text))
    _keep(module, symbols)
    backend.inline(module)
    text = stack.promoted(_unrolled(str(module)))
    for symbol in sorted(symbols):
        text = source_lines.entered(text, symbol)
    module = backend.parsed(source_lines.unwound(text))
    module.link_in(backend.parsed(backend.pointers(allocator)))
    _keep(module, symbols)
    for variable in module.global_variables:
        if variable.name == raised_values.NAME:
            variable.linkage = "internal"  # each object has its own copy
    backend.optimise(module)
    module.verify()
    return module


def _unrolled(text: str) -> str:
    """Return assembly with unrolled loops, see unrolling.py."""
    # The number of turns of an inner loop may depend on the turn of the outer one.
    for _ in range(_DEEPEST):
        marked = unrolling.marked(text)
        if marked is None:
            break
        module = backend.parsed(marked)
        backend.inline(module)
        text = unrolling.unmarked(str(module))
    return text


def _keep(module: Any, names: set[str]) -> None:
    """Drop code that these functions do not need."""
    for function in module.functions:
        if not function.is_declaration:
            function.linkage = "external" if function.name in names else "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    backend.drop_unused(module)


def _without_numbers(module: Any) -> None:
    """Remove numbers of this run from numba's symbols, for reproducible libraries."""
    for each in (*module.functions, *module.global_variables):
        if not each.is_declaration and (plain := _NUMBER.sub("0", each.name)) != each.name:
            each.name = plain
