"""The part of the C++ source that takes ROS messages apart and fills them, as hooks use them."""

from collections.abc import Callable
from typing import Any

from rtcf.component.declaration import Description, Input, Member, Output
from rtcf.component.message_type import Leaf, MessageType


def includes(about: Description) -> list[str]:
    """Return the headers of the messages that ports carry."""
    return sorted(
        {f"#include <{each.message.name}.h>" for each in about.members.values() if each.message}
    )


def prepare(about: Description, text: Callable[[str], str], used: set[str]) -> list[str]:
    """Return what gives outputs' messages their sizes and texts, for the constructor."""
    lines = []
    for member in about.of(Output):
        message = member.message
        if message is None:
            continue
        lines += ["        {", f"            {message.cpp} sample;"]
        for leaf in _used(member, message, used):
            if leaf.is_variable:
                lines.append(f"            sample.{_path(leaf)}.resize({leaf.type.count});")
        for path, given in (member.options.get("texts") or {}).items():
            value = (
                text(given)
                if isinstance(given, str)
                else f"{{{', '.join(text(e) for e in given)}}}"
            )
            lines.append(f"            sample.{path} = {value};")
        lines += [f"            port_{member.name}.reserve(sample);", "        }"]
    return lines


def read(member: Member, text: Callable[[str], str], used: set[str]) -> list[str]:
    """Return what brings an input's message into the record; one with too many elements is none."""
    assert member.message is not None and member.kind is Input
    name, record = member.name, f"record_.{member.name}"
    leaves = _used(member, member.message, used)
    largest = " && ".join(
        f"message.{_path(each)}.size() <= {each.type.count}U" for each in leaves if each.is_variable
    )
    lines = [
        "        {",
        f"            const rtcf::DataStatus status = port_{name}.read();",
        f"            [[maybe_unused]] const {member.message.cpp}& message = port_{name}.value();",
        f"            const bool fits = {largest or 'true'};",
        f"            {record}__new = fits && status == rtcf::DataStatus::New;",
        "            if (fits && status != rtcf::DataStatus::None) {",
        f"                {record}__valid = true;",
        *(f"                {line}" for leaf in leaves for line in _loaded(record, leaf)),
    ]
    if f"{name}__age" in used:
        lines.append(f"                {record}__age = port_{name}.age();")
    lines += ["            } else if (!fits && status == rtcf::DataStatus::New) {"]
    said = text(f"a message of {name} has more elements than declared, and is not taken")
    lines += [f"                RTCF_WARN_THROTTLE(this, 1.0, {said});", "            }"]
    if f"{name}__connected" in used:
        lines.append(f"            {record}__connected = port_{name}.connected();")
    return [*lines, "        }"]


def write(member: Member, used: set[str]) -> list[str]:
    """Return what fills an output's message from the record."""
    assert member.message is not None
    leaves = _used(member, member.message, used)
    return [
        f"            [[maybe_unused]] {member.message.cpp}& message = port_{member.name}.value();",
        *(f"            {line}" for each in leaves for line in _stored(member, each)),
    ]


def _used(member: Member, message: MessageType, used: set[str]) -> list[Leaf]:
    return [each for each in message.leaves if member.name + each.field in used]


def _path(leaf: Leaf) -> str:
    return ".".join(leaf.path)


def _loaded(record: str, leaf: Leaf) -> list[Any]:
    field, value = f"{record}{leaf.field}", f"message.{_path(leaf)}"
    if leaf.is_time:
        return [f"{field} = static_cast<std::int64_t>({value}.toNSec());"]
    if not leaf.type.shape:
        return [f"{field} = static_cast<{leaf.type.cpp}>({value});"]
    lines = [f"std::copy({value}.begin(), {value}.end(), {field}.begin());"]
    if leaf.is_variable:
        lines.append(f"{record}{leaf.count} = static_cast<std::int64_t>({value}.size());")
    return lines


def _stored(member: Member, leaf: Leaf) -> list[str]:
    field, value = f"record_.{member.name}{leaf.field}", f"message.{_path(leaf)}"
    if leaf.is_time:
        return [f"rtcf::python::setTime({value}, {field});"]
    if not leaf.type.shape:
        return [f"{value} = {field};"]
    return [f"std::copy({field}.begin(), {field}.end(), {value}.begin());"]
