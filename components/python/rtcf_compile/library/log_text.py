"""Checks the format strings of log calls: Python, in tests, and libfmt, in the loop, must give them
the same meaning.
"""

import re
import string

from rtcf_compile.rewriting.logs import LogCall, Logs
from rtcf_compile.source.mistake import Mistake, Mistakes

# Fill and alignment, sign, alternate form, zeros, width, precision, type.
_BOTH = re.compile(
    r"(?:[^{}]?[<>^])?[+\- ]?#?0?(?P<width>\d*)(?P<precision>\.\d+)?(?P<type>[a-zA-Z]?)"
)
_FLOAT, _WHOLE = "eEfFgG", "bcdoxX"


def check(logs: Logs) -> None:
    """Check all log calls of a component; raise Mistake with all errors."""
    mistakes = Mistakes()
    for call in logs.calls:
        with mistakes.collected():
            checked(call)
    mistakes.report()


def checked(call: LogCall) -> tuple[str, list[str]]:
    """Return the text and the types in which its arguments are stored; raise Mistake on error.

    An int that the text formats as a float, with `{:.3f}`, is stored as a float.
    """
    types = list(call.types)
    shown: list[set[bool]] = [set() for _ in types]
    following = 0
    try:
        fields = list(string.Formatter().parse(call.text))
    except ValueError as error:
        raise _mistake(call, str(error), "write {} for an argument, {{ for a {") from None
    numbered = {bool(field) for _, field, _, _ in fields if field is not None}
    if len(numbered) > 1:
        raise _mistake(call, "has {} and {0} in one text", "use one form")
    for _, field, form, conversion in fields:
        if field is None:
            continue
        if conversion == "s":
            raise _mistake(call, "joins a number to a text", "write str(…), or a {} for it")
        if conversion:
            raise _mistake(call, f"!{conversion} is not supported", "write {}")
        if field and not field.isdigit():
            raise _mistake(call, f"{{{field}}} is named", "write {}, and the arguments in order")
        number = int(field) if field else following
        following += 1
        if number >= len(types):
            raise _mistake(
                call, "has more placeholders than arguments", "give an argument for each {}"
            )
        shown[number].add(_is_float(call, form or "", types[number]))
    if not all(shown):
        raise _mistake(call, "has fewer placeholders than arguments", "write a {} for each")
    for number, ways in enumerate(shown):
        if len(ways) > 1 and types[number] != "float64":
            raise _mistake(
                call, f"shows argument {number} as an int and as a float", "give it twice"
            )
        if ways == {True}:
            types[number] = "float64"
    return call.text, types


def _is_float(call: LogCall, form: str, kind: str) -> bool:
    """Tell whether a placeholder formats a float; raise Mistake if its argument is no match."""
    found = _BOTH.fullmatch(form)
    if found is None:
        remedy = "write width, precision and type: {:8.3f}"
        raise _mistake(call, f"{{:{form}}} is not supported", remedy)
    if found["type"] and found["type"] not in (_FLOAT if kind == "float64" else _FLOAT + _WHOLE):
        remedy = "write {:d} for an int, {:.3f} for a float"
        raise _mistake(call, f"{{:{form}}} cannot show a {kind}", remedy)
    if found["type"]:
        return found["type"] in _FLOAT
    return kind == "float64" or bool(found["precision"])


def _mistake(call: LogCall, what: str, remedy: str) -> Mistake:
    return Mistake(call.file, call.line, what, remedy)
