"""Builds components and parameters from the words of a command line.

Values are YAML 1.2 scalars: true and false, integers (also 0x and 0o),
floating-point numbers (also 1e-3, .inf, .nan), and strings.  A quoted value is
always a string.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, MutableSequence
from typing import TypeVar

from rtcf.v1 import control_pb2, graph_pb2

Item = TypeVar("Item")

_INT = re.compile(r"[-+]?[0-9]+")
_HEX_OR_OCTAL = re.compile(r"0x[0-9a-fA-F]+|0o[0-7]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"([-+]?)\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_BOOLS = {
    "true": True, "True": True, "TRUE": True,
    "false": False, "False": False, "FALSE": False,
}  # fmt: skip
_INT_RANGE = range(-(2**63), 2**63)
_LONGEST_INT = 100  # characters, including leading zeros


def several(name: str, given: Iterable[Item]) -> Iterable[Item]:
    """Return `given`; raises TypeError if it is a string, whose letters would be the items."""
    if isinstance(given, str | bytes):
        raise TypeError(f"{name} must be a list: [{given!r}], not {given!r}")
    return given


def component(
    package: str,
    type_name: str,
    *,
    name: str = "",
    ns: str = "",
    remaps: Iterable[str] = (),
    parameters: Iterable[str] = (),
    first: bool = False,
    ignore: str = "",
    breaks: Iterable[str] = (),
    every: int = 0,
    phase: int | None = None,
    optional: bool = False,
) -> graph_pb2.ComponentSpec:
    """Return a component to load.

    `remaps` are "from:=to", `parameters` are "name:=value", `breaks` are input
    ports; the other arguments are fields of ComponentSpec.  Raises ValueError, or TypeError for a
    string in the place of a list.
    """
    return graph_pb2.ComponentSpec(
        name=name,
        ns=ns,
        package=package,
        type=type_name,
        remaps=[parse_remap(text) for text in several("remaps", remaps)],
        parameters=[parse_parameter(text) for text in several("parameters", parameters)],
        first=first,
        ignore=ignore,
        breaks=several("breaks", breaks),
        every=every,
        phase=phase,
        optional=optional,
    )


def parse_remap(text: str) -> graph_pb2.Remap:
    """Return the remap "from:=to"; raises ValueError."""
    source, target = _split(text, "a remap is from:=to")
    if not target:
        raise ValueError(f'"{text}": a remap is from:=to')
    return graph_pb2.Remap(source=source, target=target)


def parse_parameter(text: str) -> graph_pb2.ParameterSetting:
    """Return the setting "name:=value"; raises ValueError."""
    name, value = _split(text, "a parameter is name:=value")
    return graph_pb2.ParameterSetting(name=name, value=parse_value(value))


def parse_value(text: str) -> graph_pb2.ParameterValue:
    """Return a value with its type by YAML 1.2; raises ValueError."""
    text = text.strip()
    if text in _BOOLS:
        return graph_pb2.ParameterValue(bool_value=_BOOLS[text])
    if _INT.fullmatch(text) or _HEX_OR_OCTAL.fullmatch(text):
        # Python rejects integers of thousands of digits with another message.
        if len(text) > _LONGEST_INT:
            raise ValueError(f"{text[:20]}… does not fit into 64 bits")
        number = int(text) if _INT.fullmatch(text) else int(text, 0)
        if number not in _INT_RANGE:
            raise ValueError(f"{text} does not fit into 64 bits")
        return graph_pb2.ParameterValue(int_value=number)
    if _FLOAT.fullmatch(text):
        return graph_pb2.ParameterValue(double_value=float(text))
    if special := _SPECIAL.fullmatch(text):
        return graph_pb2.ParameterValue(
            double_value=float("nan") if special[3] else float(f"{special[1]}inf")
        )
    return graph_pb2.ParameterValue(string_value=_unquoted(text))


def flat(
    name: str, value: object, lists: MutableSequence[graph_pb2.ListLength]
) -> Iterator[tuple[str, object]]:
    """Yield the parameters that a value sets: those of a group for a mapping, `gains/p`, and the
    elements of an array or vector for a list or a NumPy array, `gains_0`.

    `lists` gets the lists.  Raises ValueError for an empty mapping.
    """
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, Mapping):
        if not value:
            raise ValueError(f"{name} is empty")
        for key, member in value.items():
            yield from flat(f"{name}/{key}", member, lists)
    elif isinstance(value, list | tuple):
        lists.append(graph_pb2.ListLength(name=name, length=len(value)))
        for index, element in enumerate(value):
            yield from flat(f"{name}_{index}", element, lists)
    else:
        yield name, value


def parse_port(text: str) -> control_pb2.PortName:
    """Return the port "component.port"; raises ValueError."""
    name, dot, port = text.rpartition(".")
    if not (name and dot and port):
        raise ValueError(f'"{text}": a port is COMPONENT.PORT')
    return control_pb2.PortName(component=name, port=port)


def _split(text: str, rule: str) -> tuple[str, str]:
    left, sign, right = text.partition(":=")
    if not (sign and left.strip()):
        raise ValueError(f'"{text}": {rule}')
    return left.strip(), right.strip()


def _unquoted(text: str) -> str:
    if len(text) >= 2 and text[0] == text[-1] == "'":
        return text[1:-1].replace("''", "'")
    if len(text) >= 2 and text[0] == text[-1] == '"':
        import yaml  # for its escapes; rarely needed, and slow to import

        try:
            return str(yaml.safe_load(text))
        except yaml.YAMLError as error:
            raise ValueError(f"{text}: {' '.join(str(error).split())}") from None
    return text
