"""numba's errors in one line: place, mistake and way out, without a word of numba's."""

import re
from types import FunctionType
from typing import Any

from rtcf_compile.rewriting import helpers, numpy_functions
from rtcf_compile.source.mistake import Mistake, source_line

_MARK = re.compile(r"RTCF:([^:\n]+):([^\n]+?)(?:\x1b|\n|$)")
# A function that has no implementation for such types.
_NONE_FOR = re.compile(
    r"No implementation of function Function\((?P<function>[^\n]*?)\) found for "
    r"signature:\s*>>> (?P<name>\w+)\((?P<arguments>[^\n]*)\)"
)
_INVALID = re.compile(
    r"Invalid use of (?P<called>[^\n]*) with parameters \((?P<arguments>[^\n]*?)\)\s*(?:\n|$)"
)
_OPERATORS = {
    **{"add": "+", "sub": "-", "mul": "*", "truediv": "/", "floordiv": "//", "mod": "%"},
    **{"pow": "**", "and_": "&", "or_": "|", "xor": "^", "lshift": "<<", "rshift": ">>"},
    **{"iadd": "+=", "isub": "-=", "imul": "*=", "itruediv": "/=", "ifloordiv": "//="},
    **{"imod": "%=", "iand": "&=", "ior": "|=", "ixor": "^=", "ilshift": "<<=", "irshift": ">>="},
    **{"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">=", "is_": "is"},
    **{"neg": "-", "pos": "+", "invert": "~", "not_": "not", "contains": "in"},
}
_BITS = ("&", "|", "^", "<<", ">>", "~")
# Functions' names in the source, by the helpers in their place.
NAMES = {
    own.__name__: f"{'np.linalg' if 'linalg' in module else 'np'}.{of.__name__}"
    for of, own in (*helpers.INSTEAD.items(), *numpy_functions.STANDS_FOR)
    # ufuncs have no module.
    if (module := getattr(of, "__module__", None) or "numpy").startswith("numpy")
}
_SIMPLE = {
    **{"float64": "a float", "float32": "a float", "unicode_type": "a text", "none": "None"},
    **{"bool": "a bool", "boolean": "a bool", "omitted": "nothing", "Literal[str]": "a text"},
    **{"complex128": "a complex number", "...": "..."},
}
# `{0}` is the first word found, `{kind0}` the type that it says.
_KNOWN: tuple[tuple[str, str, str], ...] = (
    (
        r"Use of unsupported NumPy function '?(?:numpy\.)?([\w.]+)",
        "np.{0} is not compiled",
        "write it as arithmetic on elements",
    ),
    (r"bool\(OptionalType", "may be None, or 0", "write `is not None`"),
    (
        r"Casting ([^\n]*) to (\w+) directly",
        "np.{1} of {kind0}",
        "give it a number, or write x.astype(np.{1}) of an array",
    ),
    (
        r"Unknown attribute '(\w+)' of type Module\(<module 'numpy([\w.]*)'",
        "np{1}.{0} is not compiled",
        "write it as arithmetic on elements",
    ),
    (
        r"Unknown attribute '(\w+)' of type Module\(<module '([\w.]+)'",
        "{1}.{0} is not compiled",
        "write it as arithmetic",
    ),
    (
        r"Unknown attribute '(\w+)' of type ([^\n]*)",
        "{kind1} has no {0} that is compiled",
        "use functions of NumPy on numbers and arrays",
    ),
    (
        r"Cannot resolve setattr: \((.*)\)\.(\w+) = ",
        "{kind0} has no {1} to be set",
        "leave it out, or declare a State for it",
    ),
    (
        r"Cannot unify ([^\n]*) and ([^\n]*) for '([A-Za-z]\w*)[\w.]*'",
        "{2} is once {kind0}, once {kind1}",
        "give it one type, as 0.0 for a float",
    ),
    (
        r"Cannot unify ([^\n]*) and ([^\n]*) for '",
        "is once {kind0}, once {kind1}",
        "give it one type, as 0.0 for a float",
    ),
    (
        r"Can't unify return type from the following types: ([^\n]*)",
        "returns several types: {kinds0}",
        "return one type",
    ),
    (
        r"Untyped global name '(\w+)': [^\n]*(?:class|type) '?(?:[\w.]+)",
        "{0} is not compiled",
        "use numbers, tuples of numbers, and arrays",
    ),
    (
        r"cannot determine Numba type of <class '(?:\w+\.)*(\w+)'>",
        "a {0} is not compiled",
        "use numbers and arrays",
    ),
    (
        r"undecided|Type of variable '([\w.]+)' cannot be determined",
        "has no type",
        "give it a value before it is used",
    ),
    (r"tuple index out of range", "an index is beyond the elements", "use one from 0 to size - 1"),
    (
        r"Can only index|getitem|setitem",
        "cannot be indexed so",
        "use an int or a slice as the index",
    ),
)


def mistake(error: Any, function: FunctionType) -> Mistake:
    """Return numba's error about a function as a mistake in its source."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", str(error)) or type(error).__name__
    file = function.__code__.co_filename
    # numba gives a file's path as it is, or relative to the present folder.
    name = re.escape(file.rpartition("/")[2])
    lines = [int(each) for each in re.findall(rf'File "(?:[^"]*/)?{name}", line (\d+)', text)]
    place = getattr(error, "loc", None)
    line = lines[0] if lines else getattr(place, "line", function.__code__.co_firstlineno)
    return Mistake(file, line, *_said(text, source_line(file, line)))


def _said(text: str, source: str) -> tuple[str, str]:
    """Return the mistake of a line, and the way out."""
    if found := _MARK.search(text):
        return found[1].strip(), found[2].strip()
    for pattern, what, way_out in _KNOWN[:2]:
        if found := re.search(pattern, text):
            return what.format(*found.groups()), way_out
    if found := _NONE_FOR.search(text):
        return _no_implementation(found["name"], _arguments(found["arguments"]), source)
    if found := _INVALID.search(text):
        kind = kind_of(found["called"])
        if found["called"] == "getiter":
            over = ", ".join(kind_of(each) for each in _arguments(found["arguments"]))
            return f"a loop over {over}", "use range(…) of an int, an array or a tuple"
        return f"{kind} is no function", "write * to multiply, or [0] for an element"
    for pattern, what, way_out in _KNOWN[2:]:
        if found := re.search(pattern, text):
            words = [each or "" for each in found.groups()]
            kinds = {f"kind{i}": kind_of(each) for i, each in enumerate(words)}
            several = {
                f"kinds{i}": ", ".join(kind_of(one) for one in _arguments(each))
                for i, each in enumerate(words)
            }
            return what.format(*words, **kinds, **several), way_out
    return "cannot be compiled", "write it in smaller steps, each with a name"


def _no_implementation(name: str, arguments: list[str], source: str) -> tuple[str, str]:
    """Explain a function, or an operator, that takes no such types."""
    kinds = [kind_of(each.rpartition("=")[2] if "=" in each else each) for each in arguments]
    named = [each.partition("=")[0] for each in arguments if re.match(r"\w+=", each)]
    if name == "rtcf_get" and kinds[0] == "several values":
        what = "values of several types have no variable index"
        return what, "use a constant index, or values of one type"
    if name in ("getitem", "static_getitem", "rtcf_get", "setitem", "static_setitem", "rtcf_set"):
        if kinds[0] in ("a float", "an int", "a bool", "None"):
            return f"{kinds[0]} has no elements", "write it without [ ]"
        return f"{kinds[0]} has no index {_index(arguments[1])}", "use ints, slices and arrays"
    plain = name.removeprefix("rtcf_op_").removeprefix("rtcf_element_")
    for each in (plain, f"{plain}_"):
        if each in _OPERATORS:
            return _operator(_OPERATORS[each], kinds)
    of = " and ".join(kinds)
    if name.startswith("rtcf_"):
        done = f"{NAMES[name]} of {of}" if name in NAMES else f"is not possible with {of}"
        way_out = "give it a matrix" if ".linalg." in done else "give it numbers and arrays"
        return done, way_out
    if as_written := re.search(rf"[\w.]*\b{name}(?= ?\()", source):
        name = as_written[0]
    if named:
        return f"{name} has no {named[0]} here", f"leave {named[0]} out"
    short = name.rpartition(".")[2]
    if short in ("zeros", "ones", "empty", "full", "eye", "identity", "arange"):
        return f"{name} of {of}", "make its sizes ints: int(…)"
    way_out = "give it an array or a tuple" if short in ("len", "sum", "min", "max") else ""
    return f"{name} of {of}", way_out or "give it numbers and arrays that fit it"


def _operator(operator: str, kinds: list[str]) -> tuple[str, str]:
    joined = f" {operator} ".join(kinds) if len(kinds) > 1 else f"{operator} {kinds[0]}"
    if any(each.endswith("or None") for each in kinds):
        return joined, "test it before by `is not None`"
    if "a text" in kinds:
        return joined, "use numbers: text is not made in the cycle"
    if "several values" in kinds:
        return joined, "make it an array: np.array([…])"
    if operator == "not":
        return joined, "use np.any(…) or np.all(…)"
    if operator in _BITS:
        return joined, "use ints, bools, or arrays of them; join conditions by `and`, `or`, `not`"
    return joined, "use numbers and arrays"


def _index(text: str) -> str:
    """Return an index in words."""
    if re.match(r"(?:Uni)?Tuple\(", text):
        inner = text.partition("(")[2].rpartition(")")[0]
        if found := re.fullmatch(r"(.*) x (\d+)", inner):
            return f"of {found[2]} places"
        return ", ".join(kind_of(each) for each in _arguments(inner))
    return kind_of(text)


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


def kind_of(text: str) -> str:
    """Return numba's name of a type in words."""
    text = text.strip().strip("'\"")
    text = re.sub(r"^(?:readonly |unaligned )+", "", text)
    if text in _SIMPLE:
        return _SIMPLE[text]
    if re.match(r"u?int\d+$|Literal\[int\]", text):
        return "an int"
    if text.startswith("Literal["):
        return _SIMPLE.get(text.partition("(")[0], "a constant")
    if found := re.match(r"OptionalType\((.*)\)$", text):
        return f"{kind_of(found[1])} or None"
    if found := re.match(r"array\((?:[^,]*?)(\w+), (\d)d", text):
        return _array(found[1], int(found[2]))
    if found := re.match(r"nestedarray\((\w+), \(([\d, ]+?),?\)\)", text):
        return _array(found[1], found[2].count(",") + 1)
    if found := re.match(r"IntEnum class<\w+>?\((\w+)", text):
        return f"the enum {found[1]}"
    if found := re.match(r"IntEnum<\w+>?\((\w+)", text):
        return f"a {found[1]}"
    if re.match(r"(?:Uni)?Tuple\(", text):
        return "several values"
    for begin, kind in (
        ("slice", "a slice"),
        ("Function", "a function"),
        ("type(CPUDispatcher", "a function"),
        ("class(", "a type"),
        ("range", "a range"),
        ("Module", "a module"),
        ("Ellipsis", "..."),
    ):
        if text.startswith(begin):
            return kind
    return "a value of another kind"


def _array(element: str, dimensions: int) -> str:
    shape = {1: "a vector", 2: "a matrix"}.get(dimensions, f"an array of {dimensions} dimensions")
    return f"{shape} of {element}"
