"""The tables of a library, from which the runtime makes components. tables.hpp has the same members
in the same order.
"""

import enum
from collections.abc import Sequence

import numpy as np
from rtcf.component.declaration import (
    HOOKS,
    REALTIME_HOOKS,
    TIME_FIELDS,
    Derived,
    Input,
    Member,
    Output,
    Parameter,
    Queue,
    State,
    own_field,
)
from rtcf.component.message_type import MessageType
from rtcf.component.value_type import ValueType, number_of

from rtcf_compile.library import log_text, messages
from rtcf_compile.library.llvm_data import NULL, Data, Value, pointer_to
from rtcf_compile.machine_code import backend
from rtcf_compile.machine_code.compiled import Compiled
from rtcf_compile.rewriting.logs import LogCall
from rtcf_compile.source.mistake import display, source_line
from rtcf_compile.source.prefix_map import mapped

TABLES = 5
_WHOLE = ("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
SCALARS = {name: i for i, name in enumerate(("bool", *_WHOLE, "float32", "float64"))}
_LEVELS = {"debug": 1, "info": 2, "warn": 3, "error": 4, "fatal": 5}
_LLVM = {"bool": "i8", "int64": "i64", "float64": "double"}
_NOWHERE = -1

# The result and parameter types of the functions of an array type. Functions that return a C++
# object store it at the address in a hidden first argument. A shared_ptr has two words; a string
# and an optional vector have four.
_POINTER, _OBJECT, _TEXT = "i8*", "[2 x i64]", "[4 x i64]"
_FUNCTIONS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("make_slot", _OBJECT, (_POINTER,)),
    ("copy", "void", (_POINTER, _POINTER)),
    ("exchange", "void", (_POINTER, _POINTER)),
    ("length", "i32", (_POINTER,)),
    ("serialize", "void", (_POINTER, _POINTER, "i32")),
    ("deserialize", "zeroext i1", (_POINTER, _POINTER, "i32")),
    ("print", _TEXT, (_POINTER,)),
    ("finite", "zeroext i1", (_POINTER,)),
    ("sample", _TEXT, ()),
    ("copies", _TEXT, ()),
    ("print_state", _TEXT, (_POINTER,)),
)
_HOOK, _HOOK_WITH_PORTS = "i8* (i8*)", "i8* (i8*, i8**)"
_CREATE = "i8* (i8*, i8*)"


def assembly(compiled: Sequence[Compiled]) -> str:
    """Return the tables of these components as LLVM assembly."""
    library = _Library()
    tables = [library.component(each) for each in compiled]
    pointers = library.data.array(tables)
    own = library.data.struct(pointers, len(tables))
    library.data.name(f"rtcf_python_library_{TABLES}", own, "hidden")
    return library.data.assembly()


class _Library:
    """The tables of one library."""

    def __init__(self) -> None:
        self.data = Data()
        self._types: dict[tuple[str, int, int, int], Value] = {}
        self._messages: dict[str, Value] = {}
        self._components = 0
        self.data.add("declare hidden i8* @rtcf_python_create(i8*, i8*)")
        self.data.add("declare hidden void @rtcf_python_log(i8*, i64, i64*)")
        for name, result, taken in _FUNCTIONS:
            arguments = ", ".join([*_hidden(result), _POINTER, *taken])
            self.data.add(f"declare hidden {_result(result)} @rtcf_python_{name}({arguments})")

    def component(self, compiled: Compiled) -> Value:
        """Define the table of a component; return its address."""
        for number, call in enumerate(compiled.logs.calls):
            if len(call.types) == call.count:  # else no hook contains it
                self._log(compiled.logs.symbol(number), call)
        about, number = compiled.description, self._components
        self._components += 1
        record = _record(compiled)
        create = f"rtcf_create_{number}"
        table = self.data.struct(
            about.name,
            about.doc,
            display(mapped(compiled.file)),
            pointer_to(create, _CREATE),
            self.data.bytes(record.tobytes(), 8),
            record.nbytes,
            *(self._hook(compiled, hook) for hook in HOOKS),
            sum(2**i for i, name in enumerate(TIME_FIELDS) if own_field(name) in compiled.used),
            *self._array([self._input(compiled, m) for m in _of(compiled, Input, Queue)]),
            *self._array([self._output(compiled, m) for m in _of(compiled, Output)]),
            *self._array([e for m in _of(compiled, Parameter) for e in self._parameter(m, record)]),
            *self._array([self._derived(m, record) for m in _of(compiled, Derived)]),
            *self._array([self._state(m, record) for m in _of(compiled, State)]),
            *self._array(
                [
                    self.data.struct(_signed(key), each.line, each.text, int(each.has_values))
                    for key, each in compiled.raises.items()
                ]
            ),
            *self._array(self._lines(compiled)),
        )
        own = self.data.name(f"rtcf_component_{number}", table)
        self.data.add(
            f"define internal i8* @{create}(i8* %name, i8* %context) uwtable {{\n"
            f"  %made = tail call i8* @rtcf_python_create({own}, i8* %context)\n"
            "  ret i8* %made\n}"
        )
        return own

    def _array(self, values: list[Value]) -> tuple[Value, int]:
        return self.data.array(values), len(values)

    def _hook(self, compiled: Compiled, hook: str) -> Value:
        if hook not in compiled.hooks:
            return NULL
        kind = _HOOK_WITH_PORTS if hook in REALTIME_HOOKS else _HOOK
        self.data.add(f"declare {kind.replace('(', f'@{compiled.symbol(hook)}(', 1)}")
        return pointer_to(compiled.symbol(hook), kind)

    def _input(self, compiled: Compiled, member: Member) -> Value:
        place, name = _Places(compiled), member.name
        is_queue = member.kind is Queue
        own = None if is_queue else f"{name}__new"
        warning = f"a message of {name} has more elements than declared and is ignored"
        return self.data.struct(
            name,
            *_texts(member),
            None if member.message else self._type(member.type),
            self._message(member.message),
            self._queue(compiled, member) if is_queue else None,
            _NOWHERE if member.message else place.of(name),
            place.of(own) if own else _NOWHERE,
            _NOWHERE if is_queue else place.used(f"{name}__age"),
            place.of(f"{name}__connected") if is_queue else place.used(f"{name}__connected"),
            *self._leaves(compiled, member),
            self._site("warn", warning, compiled.file, member.line, "update"),
        )

    def _queue(self, compiled: Compiled, member: Member) -> Value:
        place = _Places(compiled)
        fields = ("times", "oldest", "count", "dropped")
        places = [place.of(f"{member.name}__{each}") for each in fields]
        return self.data.address(self.data.struct(member.size, *places))

    def _output(self, compiled: Compiled, member: Member) -> Value:
        place, name, options = _Places(compiled), member.name, member.options
        return self.data.struct(
            name,
            *_texts(member),
            None if member.message else self._type(member.type),
            self._message(member.message),
            int(bool(options.get("finite"))),
            place.of(f"{name}__written"),
            *self._leaves(compiled, member),
            *self._array(self._texts(member)),
        )

    def _leaves(self, compiled: Compiled, member: Member) -> tuple[Value, int]:
        if member.message is None:
            return NULL, 0
        place, found = _Places(compiled), []
        for index, leaf in enumerate(member.message.leaves):
            field = member.name + leaf.field
            if field not in compiled.used:
                continue
            has_count = leaf.is_variable and member.kind is Input
            count = place.of(member.name + leaf.count) if has_count else _NOWHERE
            found.append(self.data.struct(index, place.of(field), count, leaf.type.count))
        return self._array(found)

    def _texts(self, member: Member) -> list[Value]:
        message, found = member.message, []
        for path, given in (member.options.get("texts") or {}).items():
            assert message is not None
            texts = [given] if isinstance(given, str) else [str(each) for each in given]
            index = len(message.leaves) + message.texts.index(tuple(path.split(".")))
            values = [self.data.text(each) for each in texts]
            found.append(self.data.struct(index, self.data.array(values), len(values)))
        return found

    def _message(self, message: MessageType | None) -> Value | None:
        """Return the address of the adapter of a message, or None."""
        if message is None:
            return None
        if message.name not in self._messages:
            name, kind = messages.symbol(message), "{ i8*, i8* }"
            self.data.add(f"@{name} = external hidden constant {kind}")
            self._messages[message.name] = pointer_to(name, kind)
        return self._messages[message.name]

    def _parameter(self, member: Member, record: np.ndarray) -> list[Value]:  # type: ignore[type-arg]
        """Return the table entries of the elements of a parameter."""
        options, offset = member.options, _offset(record, member.name)
        bounds = [options.get(each) for each in ("min", "max")]
        enumeration = member.type.enumeration
        # Aliases follow the canonical names.
        named: dict[str, enum.Enum] = {}
        if enumeration:
            named = {each.name: each for each in enumeration} | dict(enumeration.__members__)
        table = self._array(
            [self.data.struct(name, number_of(each)) for name, each in named.items()]
        )
        return [
            self.data.struct(
                name,
                *_texts(member),
                SCALARS[member.type.scalar.name],
                offset + i * member.type.scalar.itemsize,
                *(int(each is not None) for each in bounds),
                *(float(each if each is not None else 0.0) for each in bounds),
                *table,
                int(bool(options.get("fixed", False))),
            )
            for i, name in enumerate(member.elements)
        ]

    def _derived(self, member: Member, record: np.ndarray) -> Value:  # type: ignore[type-arg]
        size = member.type.count * member.type.scalar.itemsize
        return self.data.struct(_offset(record, member.name), size)

    def _state(self, member: Member, record: np.ndarray) -> Value:  # type: ignore[type-arg]
        offset = _offset(record, member.name)
        live = int(bool(member.options.get("live", False)))
        kind = self._type(member.type.stored)
        return self.data.struct(member.outer_name, *_texts(member), kind, offset, live)

    def _lines(self, compiled: Compiled) -> list[Value]:
        numbers = {*compiled.lines, *(each.line for each in compiled.raises.values())} - {0}
        return [
            self.data.struct(each, source_line(compiled.file, each)) for each in sorted(numbers)
        ]

    def _type(self, kind: ValueType) -> Value:
        """Return the address of the table of a type."""
        depth = kind.shape[0] if len(kind.shape) == 3 else 0
        rows, columns = (*kind.shape[-2:], 1)[:2] if kind.shape else (0, 0)
        if kind.shape and not depth and not kind.is_float:
            rows, columns = kind.count, 1
        key = (kind.scalar.name, rows, columns, depth)
        if key not in self._types:
            name = f"rtcf_type_{len(self._types)}"
            functions = [
                pointer_to(f"{name}_{each}", _kind(result, taken)) if rows else NULL
                for each, result, taken in _FUNCTIONS
            ]
            table = self.data.struct(SCALARS[key[0]], rows, columns, depth, *functions)
            self._types[key] = self.data.name(name, table)
            if rows:
                for each, result, taken in _FUNCTIONS:
                    self.data.add(_forward(f"{name}_{each}", each, self._types[key], result, taken))
        return self._types[key]

    def _site(self, level: str, text: str, file: str, line: int, function: str) -> Value:
        return self.data.struct(
            Value("i8", str(_LEVELS[level])),
            display(mapped(file)),
            Value("i32", str(line)),
            function,
            text,
        )

    def _log(self, symbol: str, call: LogCall) -> None:
        """Define the function that compiled code calls to log; it passes its arguments as words."""
        text, types = log_text.checked(call)
        scalars = self.data.array([self.data.value(SCALARS[each]) for each in types])
        site = self._site(call.level, text, call.file, call.line, call.function)
        table = self.data.address(self.data.struct(site, len(types), scalars))
        taken = ["i64 %component", *(f"{_LLVM[e]} %a{i}" for i, e in enumerate(call.types))]
        room = f"[{max(1, len(types))} x i64]"
        lines = [f"define hidden void @{symbol}({', '.join(taken)}) uwtable {{"]
        lines.append(f"  %values = alloca {room}")
        for i, (given, stored) in enumerate(zip(call.types, types, strict=True)):
            lines += [
                *_word(given, stored, i),
                f"  %place{i} = getelementptr {room}, {room}* %values, i64 0, i64 {i}",
                f"  store i64 %word{i}, i64* %place{i}",
            ]
        lines += [
            f"  %first = getelementptr {room}, {room}* %values, i64 0, i64 0",
            f"  call void @rtcf_python_log({table}, i64 %component, i64* %first)",
            "  ret void\n}",
        ]
        self.data.add("\n".join(lines))


class _Places:
    """Offsets of fields in the record."""

    def __init__(self, compiled: Compiled) -> None:
        self._record, self._used = compiled.description.record, compiled.used

    def of(self, name: str) -> int:
        """Return the offset of a field."""
        assert self._record.fields is not None
        return int(self._record.fields[name][1])

    def used(self, name: str) -> int:
        """Return the offset of a field; -1 if no hook uses it."""
        return self.of(name) if name in self._used else _NOWHERE


def _of(compiled: Compiled, *kinds: type) -> list[Member]:
    """Return the members of some kinds in order of declaration."""
    return [each for each in compiled.description.members.values() if each.kind in kinds]


def _record(compiled: Compiled) -> "np.ndarray[tuple[()], np.dtype[np.void]]":
    """Return the initial record of a component."""
    about = compiled.description
    record = np.zeros((), about.record)
    head = [own_field(name) for name in ("component", *TIME_FIELDS, "line")]
    assert [_offset(record, name) for name in head] == list(range(0, 64, 8)), "see RecordHead"
    for member in about.of(State) + about.of(Parameter):
        record[member.name] = member.initial
    return record


def _texts(member: Member) -> list[str]:
    """Return the unit and the documentation of a member."""
    return [str(member.options.get(each, "")) for each in ("unit", "doc")]


def _offset(record: np.ndarray, name: str) -> int:  # type: ignore[type-arg]
    assert record.dtype.fields is not None
    return int(record.dtype.fields[name][1])


def _signed(number: int) -> int:
    return number - 2**64 if number >= 2**63 else number


def _hidden(result: str) -> list[str]:
    """Return the hidden argument with the address of the result, if the result is an object."""
    return [f"{result}* sret({result})"] if result.startswith("[") else []


def _result(result: str) -> str:
    return "void" if result.startswith("[") else result


def _kind(result: str, taken: tuple[str, ...]) -> str:
    """Return the LLVM type of a function."""
    given = [f"{result}*"] if result.startswith("[") else []
    return f"{_result(result).removeprefix('zeroext ')} ({', '.join([*given, *taken])})"


def _forward(name: str, function: str, table: Value, result: str, taken: tuple[str, ...]) -> str:
    """Return a function that calls the runtime with the table of the type and its own arguments."""
    place = [f"{each} %result" for each in _hidden(result)]
    own = [f"{each} %a{i}" for i, each in enumerate(taken)]
    called = f"call {_result(result)} @rtcf_python_{function}("
    called += f"{', '.join([*place, str(table), *own])})"
    head = f"define internal {_result(result)} @{name}({', '.join([*place, *own])}) uwtable {{\n"
    if _result(result) == "void":
        return f"{head}  tail {called}\n  ret void\n}}"
    plain = _result(result).removeprefix("zeroext ")
    return f"{head}  %value = tail {called}\n  ret {plain} %value\n}}"


def _word(given: str, stored: str, number: int) -> list[str]:
    """Return the instructions that convert an argument to 64 bits."""
    value, word = f"%a{number}", f"%word{number}"
    if given == "float64":
        return [f"  {word} = bitcast double {value} to i64"]
    whole = f"%whole{number}" if stored == "float64" else word
    widened = f"zext i8 {value} to i64" if given == "bool" else f"add i64 {value}, 0"
    lines = [f"  {whole} = {widened}"]
    if stored == "float64":
        lines.append(f"  %real{number} = sitofp i64 {whole} to double")
        lines.append(f"  {word} = bitcast double %real{number} to i64")
    return lines


def object_file(compiled: Sequence[Compiled]) -> bytes:
    """Return the object file of the tables."""
    return backend.emitted(assembly(compiled))
