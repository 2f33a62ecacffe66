"""The C++ source around compiled code: an ordinary component, with the ports, parameters and
state that the class declares, by the public headers.
"""

import math
from typing import Any

import numpy as np
from rtcf.component.declaration import (
    Derived,
    Description,
    Input,
    Member,
    Output,
    Parameter,
    Queue,
    State,
)
from rtcf.component.value_type import ValueType

from rtcf_compile.library import messages
from rtcf_compile.machine_code.lowering import Compiled
from rtcf_compile.source.mistake import display, source_line

_NUMBER = {"float32": "float", "float64": "double"}


def source(compiled: list[Compiled]) -> str:
    """Return the source of a library of these components."""
    parts = [
        "// Made by rtcf-compile. What it says is in the Python source.",
        '#include "runtime.hpp"',
        *sorted({line for each in compiled for line in messages.includes(each.description)}),
        "",
    ]
    for each in compiled:
        parts += [_component(each), ""]
    return "\n".join(parts)


def _component(compiled: Compiled) -> str:
    name, about = compiled.description.name, compiled.description
    lines = ['extern "C" {', *_declarations(compiled), "}", "", f"namespace python_{name} {{", ""]
    lines += [*_record(about), "", *_meanings(compiled), "", *_class(compiled), ""]
    lines += [f"}}  // namespace python_{name}", ""]
    lines += _logs(compiled)
    lines.append(
        f"RTCF_COMPONENT_NAMED(python_{name}::Component, {_text(name)}, {_text(about.doc)}, {name})"
    )
    return "\n".join(lines)


def _declarations(compiled: Compiled) -> list[str]:
    found = [f"const void* {compiled.symbol(hook)}(void* record);" for hook in compiled.hooks]
    for number, call in enumerate(compiled.logs.calls):
        types = ["std::int64_t", *call.types]
        found.append(f"void {compiled.logs.symbol(number)}({', '.join(types)});")
    return found


def _record(about: Description) -> list[str]:
    record = about.record
    lines = ["struct Record {"]
    for name, (dtype, _) in _fields(record):
        element, shape = dtype.subdtype if dtype.subdtype else (dtype, ())
        lines.append(f"    {_field_type(element, shape)} {name}{{}};")
    lines.append("};")
    lines.append(f"static_assert(sizeof(Record) == {record.itemsize});")
    for name, (_, offset) in _fields(record):
        lines.append(f"static_assert(offsetof(Record, {name}) == {offset});")
    return lines


def _fields(record: np.dtype[Any]) -> list[tuple[str, Any]]:
    assert record.fields is not None and record.names is not None
    return [(name, record.fields[name][:2]) for name in record.names]


def _field_type(element: np.dtype[Any], shape: tuple[int, ...]) -> str:
    cpp = ValueType(element).cpp
    return f"std::array<{cpp}, {int(np.prod(shape))}>" if shape else cpp


def _meanings(compiled: Compiled) -> list[str]:
    raises = compiled.raises
    lines = [f"constexpr std::array<rtcf::python::Meaning, {len(raises)}> kMeanings{{{{"]
    lines += [f"    {{{key}U, {each.line}, {_text(each.text)}}}," for key, each in raises.items()]
    lines.append("}};")
    numbers = sorted({*compiled.lines, *(each.line for each in raises.values())} - {0})
    lines.append(f"constexpr std::array<rtcf::python::SourceLine, {len(numbers)}> kLines{{{{")
    lines += [f"    {{{each}, {_text(source_line(compiled.file, each))}}}," for each in numbers]
    lines.append("}};")
    return lines


def _class(compiled: Compiled) -> list[str]:
    about = compiled.description
    lines = ["class Component final : public rtcf::Component {", "   public:", "    Component() {"]
    for member in about.of(State) + about.of(Parameter):
        lines.append(f"        record_.{member.name} = {_initial(member)};")
    lines.append("        record_._component = reinterpret_cast<std::intptr_t>(this);")
    if "prepare" in compiled.hooks:
        lines.append("        proposed_ = record_;")
    lines += messages.prepare(about, _text, compiled.used)
    for member in about.of(State):
        lines.append(
            f"        rtcf::python::declareState<{_state_type(member)}>(*this, "
            f"{_text(member.name)}, record_.{member.name}, {_option(member, 'unit')}, "
            f"{_option(member, 'doc')});"
        )
    lines += ["    }", ""]
    if "prepare" in compiled.hooks:
        lines += _prepare(compiled)
    if "start" in compiled.hooks:
        lines += [
            "    bool start() override {",
            "        prepareRecord();",
            f"        const void* const raised = {compiled.symbol('start')}(&record_);",
            '        return raised == nullptr || fail("{}", said(raised, record_._line));',
            "    }",
            "",
        ]
    lines += [
        "    void update() override {",
        "        readPorts();",
        f"        const void* const raised = {compiled.symbol('update')}(&record_);",
        "        if (__builtin_expect(static_cast<long>(raised != nullptr), 0) != 0)",
        "            throw std::runtime_error(said(raised, record_._line));",
        "        writePorts();",
        "    }",
        "",
    ]
    if "safe" in compiled.hooks:
        lines += [
            "    void safe() noexcept override {",
            "        readPorts();",
            f"        if ({compiled.symbol('safe')}(&record_) != nullptr)",
            f'            RTCF_ERROR(this, "safe() in {{}} raised at line {{}}", '
            f"{_text(display(compiled.file))}, record_._line);",
            "        writePorts();",
            "    }",
            "",
        ]
    lines += ["   private:", *_steps(compiled), ""]
    lines += [f"    {line}" for member in about.members.values() for line in _member(member)]
    lines.append("    Record record_;")
    if "prepare" in compiled.hooks:
        lines.append("    Record proposed_;")
    lines.append("};")
    return lines


def _prepare(compiled: Compiled) -> list[str]:
    about = compiled.description
    return [
        "    bool prepare(const rtcf::Values& /*proposed*/) override {",
        *_parameters(about, "proposed_", "proposed"),
        f"        const void* const raised = {compiled.symbol('prepare')}(&proposed_);",
        '        if (raised != nullptr) return fail("{}", said(raised, proposed_._line));',
        *(
            f"        derived_{each.name}.stage(proposed_.{each.name});"
            for each in about.of(Derived)
        ),
        "        return true;",
        "    }",
        "",
    ]


def _steps(compiled: Compiled) -> list[str]:
    about, used = compiled.description, compiled.used
    lines = ["    void prepareRecord() noexcept {"]
    for name in ("time", "stamp", "period", "iteration", "dt", "frequency"):
        if f"_{name}" in used:
            cast = "static_cast<std::int64_t>(iteration())" if name == "iteration" else f"{name}()"
            lines.append(f"        record_._{name} = {cast};")
    lines += _parameters(about, "record_", "value")
    lines += [f"        record_.{each.name} = *derived_{each.name};" for each in about.of(Derived)]
    lines += ["    }", "    void readPorts() noexcept {", "        prepareRecord();"]
    for member in about.of(Input):
        name = member.name
        if member.message:
            lines += messages.read(member, _text, used)
            continue
        lines += [
            "        {",
            f"            const rtcf::DataStatus status = port_{name}.read();",
            f"            record_.{name}__new = status == rtcf::DataStatus::New;",
            f"            record_.{name}__valid = status != rtcf::DataStatus::None;",
            f"            rtcf::python::load(record_.{name}, port_{name}.value());",
        ]
        if f"{name}__age" in used:
            lines.append(f"            record_.{name}__age = port_{name}.age();")
        if f"{name}__connected" in used:
            lines.append(f"            record_.{name}__connected = port_{name}.connected();")
        lines.append("        }")
    for member in about.of(Queue):
        name = member.name
        fields = ", ".join(
            f"record_.{name}{each}" for each in ("", "__times", "__oldest", "__count")
        )
        lines += [
            f"        lost_{name} += rtcf::python::receive<{member.type.count}>("
            f"port_{name}, time(), {fields});",
            f"        record_.{name}__dropped = "
            f"static_cast<std::int64_t>(port_{name}.dropped() + lost_{name});",
            f"        record_.{name}__connected = port_{name}.connected();",
        ]
    lines += [f"        record_.{each.name}__written = false;" for each in about.of(Output)]
    lines += ["    }", "    void writePorts() noexcept {"]
    for member in about.of(Output):
        name = member.name
        value = [f"            rtcf::python::store(port_{name}.value(), record_.{name});"]
        lines += [
            f"        if (record_.{name}__written) {{",
            *(messages.write(member, used) if member.message else value),
            f"            port_{name}.publish();",
            "        }",
        ]
    lines += [
        "    }",
        "    static std::string said(const void* raised, std::int64_t line) {",
        f"        return rtcf::python::say(raised, line, "
        f"{_text(display(compiled.file))}, kMeanings, kLines);",
        "    }",
    ]
    return lines


def _member(member: Member) -> list[str]:
    name, text = member.name, _text(member.name)
    if member.kind is Input:
        return [f"rtcf::Input<{_port_type(member)}> port_{name}{{this, {text}}};"]
    if member.kind is Queue:
        queue = f"rtcf::Queue<{_port_type(member)}, {member.size}>"
        return [f"{queue} port_{name}{{this, {text}}};", f"std::uint64_t lost_{name} = 0;"]
    if member.kind is Output:
        finite = ", rtcf::Finite()" if member.options.get("finite") else ""
        return [
            f"rtcf::Output<{_port_type(member)}> port_{name}{{this, {text}, "
            f"{_option(member, 'unit')}{finite}}};"
        ]
    if member.kind is Derived:
        field = _field_type(member.type.scalar, member.type.shape)
        return [f"rtcf::Derived<{field}> derived_{name}{{this}};"]
    if member.kind is Parameter:
        return [_parameter(member, number) for number in range(member.type.count)]
    return []


def _parameter(member: Member, number: int) -> str:
    """Return the declaration of a parameter, or of an element of one that is an array."""
    name, kind = member.elements[number], member.type
    options = "".join(
        f", rtcf::{option.title()}({_number(float(member.options[option]), 'float64')})"
        for option in ("min", "max")
        if option in member.options
    )
    return (
        f"rtcf::Parameter<{kind.cpp}> parameter_{name}{{this, {_text(name)}, "
        f"{_number(member.initial.ravel().tolist()[number], kind.scalar.name)}, "
        f"rtcf::Unit({_option(member, 'unit')}), rtcf::Doc({_option(member, 'doc')}){options}}};"
    )


def _parameters(about: Description, record: str, which: str) -> list[str]:
    """Return what brings parameters into a record; `which` of their values."""
    lines = []
    for member in about.of(Parameter):
        for number, name in enumerate(member.elements):
            place = f"[{number}]" if member.type.shape else ""
            lines.append(f"        {record}.{member.name}{place} = parameter_{name}.{which}();")
    return lines


def _port_type(member: Member) -> str:
    kind = member.type
    if member.message:
        return member.message.cpp
    if not kind.shape:
        return kind.cpp
    rows, columns = (*kind.shape, 1)[:2]
    if kind.is_float:
        order = ", Eigen::RowMajor" if rows == 1 and columns > 1 else ""
        return f"Eigen::Matrix<{kind.cpp}, {rows}, {columns}{order}>"
    return f"std::array<{kind.cpp}, {kind.count}>"


def _state_type(member: Member) -> str:
    kind = member.type
    if not kind.shape:
        return kind.cpp
    rows, columns = (*kind.shape, 1)[:2]
    if kind.is_float:
        return f"rtcf::python::RowByRow<{kind.cpp}, {rows}, {columns}>"
    return f"std::array<{kind.cpp}, {kind.count}>"


def _initial(member: Member) -> str:
    kind = member.type
    values = [_number(each, kind.scalar.name) for each in member.initial.ravel().tolist()]
    return f"{{{{{', '.join(values)}}}}}" if kind.shape else values[0]


def _number(value: Any, scalar: str) -> str:
    if scalar == "bool":
        return "true" if value else "false"
    if scalar not in _NUMBER:
        smallest = -(2**63)
        return (
            "std::numeric_limits<std::int64_t>::min()"
            if value == smallest
            else f"{value}{'U' if scalar.startswith('u') else ''}"
        )
    cpp = _NUMBER[scalar]
    if math.isnan(value):
        return f"std::numeric_limits<{cpp}>::quiet_NaN()"
    if math.isinf(value):
        return f"{'-' if value < 0 else ''}std::numeric_limits<{cpp}>::infinity()"
    return f"{float(value).hex()}{'F' if cpp == 'float' else ''}"


def _logs(compiled: Compiled) -> list[str]:
    lines = []
    for number, call in enumerate(compiled.logs.calls):
        names = [f"argument_{i}" for i in range(len(call.types))]
        typed = [f"{kind} {name}" for kind, name in zip(call.types, names, strict=True)]
        given = "".join(f", {name}" for name in names)
        lines += [
            f"void {compiled.logs.symbol(number)}("
            f"{', '.join(['std::int64_t component', *typed])}) {{",
            "    // In the component's record, by its constructor.",
            "    auto* const self = reinterpret_cast<rtcf::Component*>(component);",
            f"    RTCF_{call.level.upper()}(self, {_text(call.text)}{given});",
            "}",
            "",
        ]
    return lines


def _option(member: Member, option: str) -> str:
    return _text(str(member.options.get(option, "")))


def _text(text: str) -> str:
    """Return a literal of C++."""
    plain = "".join(
        each if each.isprintable() and each.isascii() and each not in '"\\?' else _escaped(each)
        for each in text
    )
    return f'"{plain}"'


def _escaped(character: str) -> str:
    # Three octal digits end by themselves; hexadecimal ones would go on.
    return "".join(f"\\{byte:03o}" for byte in character.encode())
