"""The texts of log calls: they have to mean the same to Python, for tests, and to libfmt, which
makes them when the component runs.
"""

import re
import string

from rtcf_compile.rewriting.logs import LogCall, Logs
from rtcf_compile.source.mistake import Mistake

# Fill and alignment, sign, alternate form, zeros, width, precision, type.
_BOTH = re.compile(
    r"(?:[^{}]?[<>^])?[+\- ]?#?0?(?P<width>\d*)(?P<precision>\.\d+)?(?P<type>[a-zA-Z]?)"
)
_FLOAT, _WHOLE = "eEfFgG", "bcdoxX"


def check(logs: Logs) -> None:
    """Look at all log calls of a component; raise Mistake."""
    for call in logs.calls:
        checked(call)


def checked(call: LogCall) -> tuple[str, list[str]]:
    """Return the text, and the types as which its arguments are stored; raise Mistake.

    An int that the text shows as a float, by `{:.3f}`, is stored as one.
    """
    types = list(call.types)
    shown: list[set[bool]] = [set() for _ in types]
    following = 0
    try:
        fields = list(string.Formatter().parse(call.text))
    except ValueError as error:
        raise _mistake(call, str(error), "{} stands for an argument, {{ for a {") from None
    numbered = {bool(field) for _, field, _, _ in fields if field is not None}
    if len(numbered) > 1:
        raise _mistake(call, "has {} and {0} in one text", "number all or none")
    for _, field, form, conversion in fields:
        if field is None:
            continue
        if conversion:
            raise _mistake(call, f"!{conversion} is not shown", "write {}")
        if field and not field.isdigit():
            raise _mistake(call, f"{{{field}}} has a name", "write {}, and the arguments in order")
        number = int(field) if field else following
        following += 1
        if number >= len(types):
            raise _mistake(call, "has more places than arguments", "give an argument for each {}")
        shown[number].add(_is_float(call, form or "", types[number]))
    if not all(shown):
        raise _mistake(call, "has fewer places than arguments", "write a {} for each")
    for number, ways in enumerate(shown):
        if len(ways) > 1 and types[number] != "float64":
            raise _mistake(
                call, f"shows argument {number} as an int and as a float", "give it twice"
            )
        if ways == {True}:
            types[number] = "float64"
    return call.text, types


def _is_float(call: LogCall, form: str, kind: str) -> bool:
    """Tell whether a place shows a float; raise Mistake if it cannot show its argument."""
    found = _BOTH.fullmatch(form)
    if found is None:
        way_out = "write width, precision and type: {:8.3f}"
        raise _mistake(call, f"{{:{form}}} is not shown", way_out)
    if found["type"] and found["type"] not in (_FLOAT if kind == "float64" else _FLOAT + _WHOLE):
        way_out = "write {:d} for an int, {:.3f} for a float"
        raise _mistake(call, f"{{:{form}}} does not show a {kind}", way_out)
    if found["type"]:
        return found["type"] in _FLOAT
    return kind == "float64" or bool(found["precision"])


def _mistake(call: LogCall, what: str, way_out: str) -> Mistake:
    return Mistake(call.file, call.line, what, way_out)
