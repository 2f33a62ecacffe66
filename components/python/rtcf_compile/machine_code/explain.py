"""numba's errors in one line: where, what, and what to write instead."""

import re
from types import FunctionType
from typing import Any

from rtcf_compile.source.mistake import Mistake

_MARK = re.compile(r"RTCF:([^:\n]+):([^\n]+?)(?:\x1b|\n|$)")
# One of our helpers that has no overload for such types.
_HELPER = re.compile(r"No implementation of function Function\(<function \w+ [^)]*\) found for "
                     r"signature:\s*>>> \w+\(([^\n]*)\)")  # fmt: skip
_KNOWN: tuple[tuple[str, str, str], ...] = (
    (
        r"Use of unsupported NumPy function '?(?:numpy\.)?([\w.]+)",
        "np.{0} is not compiled",
        "write it as arithmetic on elements",
    ),
    (r"bool\(OptionalType", "may be None, or 0", "write `is not None`"),
    (
        r"Unknown attribute '(\w+)' of type Module\(<module '(\w+)'",
        "{1}.{0} is not compiled",
        "write it as arithmetic",
    ),
    (
        r"Unknown attribute '(\w+)' of type ([^\n]*)",
        "has no {0} that can be compiled",
        "use functions of NumPy on numbers and arrays",
    ),
    (
        r"Cannot unify ([^\n]*) and ([^\n]*) for '(\w+)[\w.]*'",
        "{2} is once {0}, once {1}",
        "give it one type, as 0.0 for a float",
    ),
    (
        r"Can't unify return type from the following types: ([^\n]*)",
        "returns several types: {0}",
        "return one type",
    ),
    (
        r"Untyped global name '(\w+)': [^\n]*(?:class|type) '?([\w.]+)",
        "{0} is of type {1}",
        "constants are numbers, tuples of numbers and arrays",
    ),
    (
        r"cannot determine Numba type of <class '([\w.]+)'>",
        "a {0} is not compiled",
        "use numbers and arrays",
    ),
    (
        r"undecided|Type of variable '([\w.]+)' cannot be determined",
        "has no type",
        "give it a value before it is used",
    ),
    (
        r"No implementation of function Function\(([^)]*)\) found for signature:\s*>>> (\S[^\n]*)",
        "{1} is not possible",
        "the types do not fit: look at dimensions and at bools",
    ),
    (r"Can only index|getitem|setitem", "cannot be indexed so", "an index is an int or a slice"),
)


def mistake(error: Any, function: FunctionType) -> Mistake:
    """Return numba's error about a function as a mistake in its source."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", str(error)) or type(error).__name__
    file = function.__code__.co_filename
    # numba gives a file's path as it is, or relative to the present folder.
    name = re.escape(file.rpartition("/")[2])
    lines = [int(each) for each in re.findall(rf'File "(?:[^"]*/)?{name}", line (\d+)', text)]
    place = getattr(error, "loc", None)
    line = lines[-1] if lines else getattr(place, "line", function.__code__.co_firstlineno)
    if found := _MARK.search(text):
        return Mistake(file, line, found[1].strip(), found[2].strip())
    if found := _HELPER.search(text):
        kinds = ", ".join(_plain(each) for each in _arguments(found[1]))
        return Mistake(file, line, f"is not possible with {kinds}", "give it numbers and arrays")
    for pattern, what, way_out in _KNOWN:
        if found := re.search(pattern, text):
            words = [_plain(each or "") for each in found.groups()]
            return Mistake(file, line, what.format(*words), way_out)
    first = next((each.strip() for each in text.splitlines()[1:] if each.strip()), text[:200])
    return Mistake(file, line, f"cannot be compiled ({_plain(first)[:120]})", "write it simpler")


def _arguments(text: str) -> list[str]:
    """Return the types that stand between commas, of which they have some themselves."""
    found, depth = [""], 0
    for each in text:
        depth += (each in "([{<") - (each in ")]}>")
        if each == "," and depth == 0:
            found.append("")
        else:
            found[-1] += each
    return [each.strip() for each in found]


def _plain(words: str) -> str:
    """Return numba's names of types as NumPy has them."""
    words = re.sub(r"(?:Uni)?Tuple\(.*\)", "several values", words)
    words = re.sub(r"readonly ", "", words)
    words = re.sub(r"array\((\w+), (\d)d, \w+\)", r"\2-dimensional array of \1", words)
    words = re.sub(
        r"(?:unaligned )?nestedarray\((\w+), \(([\d, ]+?),?\)\)",
        r"array of \1 of shape (\2)",
        words,
    )
    words = re.sub(r"OptionalType\((\w+)\)", r"\1 or None", words)
    words = re.sub(r"IntEnum<\w+>?\((\w+)\)?", r"\1", words)
    words = re.sub(r"Literal\[(\w+)\]\([^)]*\)", r"\1", words)
    return words.replace("<built-in function ", "").replace(">", "").strip()
