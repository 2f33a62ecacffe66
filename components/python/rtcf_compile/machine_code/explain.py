"""Translates numba's errors into one line: place, error and remedy, without terms of numba."""

import re
from os.path import abspath, dirname
from types import FunctionType
from typing import Any

from rtcf_compile.rewriting import helpers, numpy_functions
from rtcf_compile.source.mistake import Mistake, source_line

_PACKAGE = f"{dirname(dirname(abspath(__file__)))}/"
_MARK = re.compile(r"RTCF:([^:\n]+):([^\n]+?)(?:\x1b|\n|$)")
# numba has no implementation of a function for these types.
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
_ENUM = "compare it with its members by == or is, or write .value"
_COMPLEX = "use abs(z), z.real or z.imag, or a function of cmath"
_BITS = ("&", "|", "^", "<<", ">>", "~")
# The names of functions in the source, by the helpers that replace them.
NAMES = {
    own.__name__: f"{'np.linalg' if 'linalg' in module else 'np'}.{of.__name__}"
    for of, own in (*helpers.INSTEAD.items(), *numpy_functions.STANDS_FOR)
    # ufuncs have no __module__.
    if (module := getattr(of, "__module__", None) or "numpy").startswith("numpy")
}
_SIMPLE = {
    **{"float64": "a float", "float32": "a float", "unicode_type": "a text", "none": "None"},
    **{"bool": "a bool", "boolean": "a bool", "omitted": "nothing", "Literal[str]": "a text"},
    **{"complex128": "a complex number", "...": "..."},
}
# `{0}` is the first group, `{kind0}` its type in words, `{kinds0}` its types in words.
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
        "give it a number, or write x.astype(…) for an array",
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
        r"Unknown attribute '(to_sec|to_nsec|secs|nsecs)' of type int",
        "a time is an int, in ns, which has no {0}",
        "write 1e-9 * … for seconds",
    ),
    (
        r"Unknown attribute '(\w+)' of type ((?:Int)?Enum[^\n]*)",
        "methods of an enum are not compiled",
        "write a function of the module, called with the enum",
    ),
    (
        r"Unknown attribute 'conj' of type complex",
        "a complex number has no conj",
        "write z.conjugate()",
    ),
    (
        r"Unknown attribute '(\w+)' of type Object<(\w+)>",
        "the class of the object with this {0} is not known",
        "annotate the variable with its class",
    ),
    (
        r"Unknown attribute '(\w+)' of type ([^\n]*)",
        "{kind1} has no compiled attribute {0}",
        "use NumPy functions on numbers and arrays",
    ),
    (
        r"Cannot resolve setattr: \((.*)\)\.(\w+) = ",
        "{kind0} has no attribute {1} that can be set",
        "remove it, or declare a State",
    ),
    (
        r"Cannot unify ([^\n]*) and ([^\n]*) for '([A-Za-z]\w*)[\w.]*'",
        "{2} is {kind0} in one place and {kind1} in another",
        "give it one type, such as 0.0 for a float",
    ),
    (
        r"Cannot unify ([^\n]*) and ([^\n]*) for '",
        "is {kind0} in one place and {kind1} in another",
        "give it one type, such as 0.0 for a float",
    ),
    (
        r"Can't unify return type from the following types: ([^\n]*)",
        "returns values of several types: {kinds0}",
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
        "give it a value before its use",
    ),
    (
        r"failed to unpack ([^\n]*)|typing of exhaust iter",
        "unpacks a number into several names",
        "write `for i, x in enumerate(…)`, or one name",
    ),
    (r"tuple index out of range", "an index is out of range", "use an index from 0 to size - 1"),
    (
        r"Can only index|getitem|setitem",
        "cannot be indexed like this",
        "use an int or a slice as the index",
    ),
)


def mistake(error: Any, function: FunctionType) -> Mistake:
    """Return an error of numba about a function as a Mistake in its source."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", str(error)) or type(error).__name__
    file = function.__code__.co_filename
    # numba gives the path of a file as it is, or relative to the working directory.
    name = re.escape(file.rpartition("/")[2])
    # A file of this package may have the same name.
    places = re.compile(rf'File "((?:[^"]*/)?{name})", line (\d+)')

    def lines_in(text: str) -> list[int]:
        return [int(line) for path, line in places.findall(text) if _PACKAGE not in abspath(path)]

    # Returns of several types are named in the order of a set: the last in the source is reported.
    returns = text.partition("Can't unify return type")[2].partition("During:")[0]
    lines = sorted(lines_in(returns), reverse=True)
    lines = lines or lines_in(text)
    known = getattr(error, "loc", None)
    line = lines[0] if lines else getattr(known, "line", function.__code__.co_firstlineno)
    return Mistake(file, line, *_said(text, source_line(file, line)))


def _said(text: str, source: str) -> tuple[str, str]:
    """Return the error in a line and the remedy."""
    if found := _MARK.search(text):
        return found[1].strip(), found[2].strip()
    what, remedy = _of_numba(text, source)
    if "Object<" in text and (_NONE_FOR.search(text) or _INVALID.search(text)):
        remedy = "use its fields, such as p.x"
    return what, remedy


def _of_numba(text: str, source: str) -> tuple[str, str]:
    for pattern, what, remedy in _KNOWN[:2]:
        if found := re.search(pattern, text):
            return what.format(*found.groups()), remedy
    if found := _NONE_FOR.search(text):
        return _no_implementation(found["name"], _arguments(found["arguments"]), source)
    if found := _INVALID.search(text):
        kind = kind_of(found["called"])
        if found["called"] == "getiter":
            over = ", ".join(kind_of(each) for each in _arguments(found["arguments"]))
            return f"a loop over {over}", "use range(…) of an int, an array or a tuple"
        return f"{kind} is not a function", "write * to multiply, or [0] for an element"
    for pattern, what, remedy in _KNOWN[2:]:
        if found := re.search(pattern, text):
            words = [each or "" for each in found.groups()]
            kinds = {f"kind{i}": kind_of(each) for i, each in enumerate(words)}
            several = {
                f"kinds{i}": ", ".join(kind_of(one) for one in _arguments(each))
                for i, each in enumerate(words)
            }
            return what.format(*words, **kinds, **several), remedy
    return "cannot be compiled", "write it in smaller steps, each with a name"


def _no_implementation(name: str, arguments: list[str], source: str) -> tuple[str, str]:
    """Describe a function or operator that does not accept the types of its arguments."""
    kinds = [kind_of(each.rpartition("=")[2] if "=" in each else each) for each in arguments]
    named = [each.partition("=")[0] for each in arguments if re.match(r"\w+=", each)]
    if name == "rtcf_get" and kinds[0] == "a list or tuple":
        what = "values of several types need a constant index"
        return what, "use a constant index, or values of one type"
    if name in ("getitem", "static_getitem", "rtcf_get", "setitem", "static_setitem", "rtcf_set"):
        if kinds[0] in ("a float", "an int", "a bool", "None"):
            return f"{kinds[0]} has no elements", "write it without [ ]"
        return (
            f"{kinds[0]} cannot be indexed by {_index(arguments[1])}",
            "use ints, slices and arrays",
        )
    plain = name.removeprefix("rtcf_op_").removeprefix("rtcf_element_")
    for each in (plain, f"{plain}_"):
        if each in _OPERATORS:
            return _operator(_OPERATORS[each], kinds)
    of = " and ".join(kinds)
    if "a complex number" in kinds:
        of_name = NAMES.get(name, name.removeprefix("rtcf_").replace("math_", "math."))
        return f"{of_name} of {of}", _COMPLEX
    if name.startswith("rtcf_"):
        done = f"{NAMES[name]} of {of}" if name in NAMES else f"is not possible with {of}"
        remedy = "give it a matrix" if ".linalg." in done else "give it numbers and arrays"
        return done, remedy
    if as_written := re.search(rf"[\w.]*\b{name}(?= ?\()", source):
        name = as_written[0]
    if named:
        return f"{name} takes no argument {named[0]} here", f"leave {named[0]} out"
    short = name.rpartition(".")[2]
    if short in ("zeros", "ones", "empty", "full", "eye", "identity", "arange"):
        return f"{name} of {of}", "convert its sizes to ints: int(…)"
    if any(each.startswith("an enum ") for each in kinds):
        return f"{name} of {of}", _ENUM
    remedy = "give it an array or a tuple" if short in ("len", "sum", "min", "max") else ""
    if short in ("min", "max") and len(kinds) > 1:
        remedy = f"use np.{short}imum for elements, np.{short} for one array"
    return f"{name} of {of}", remedy or "give it numbers or arrays of a suitable type"


def _operator(operator: str, kinds: list[str]) -> tuple[str, str]:
    joined = f" {operator} ".join(kinds) if len(kinds) > 1 else f"{operator} {kinds[0]}"
    if any(each.endswith("or None") for each in kinds):
        return joined, "test it before with `is not None`"
    if "a text" in kinds:
        return joined, "use numbers: the cycle cannot build text"
    if "a complex number" in kinds:
        return joined, _COMPLEX
    if any(each.startswith("an enum ") for each in kinds):
        return joined, _ENUM
    if "a list or tuple" in kinds:
        return joined, "make it an array: np.array([…])"
    if operator == "not":
        return joined, "use np.any(…) or np.all(…)"
    if operator == "^" and "a float" in kinds:
        return joined, "write ** for a power; ^ is for ints and bools"
    if operator in _BITS:
        return joined, "use ints, bools, or arrays of them; join conditions with `and`, `or`, `not`"
    return joined, "use numbers and arrays"


def _index(text: str) -> str:
    """Describe an index."""
    if re.match(r"(?:Uni)?Tuple\(", text):
        inner = text.partition("(")[2].rpartition(")")[0]
        if found := re.fullmatch(r"(.*) x (\d+)", inner):
            return f"{found[2]} indices"
        return ", ".join(kind_of(each) for each in _arguments(inner))
    return kind_of(text)


def _arguments(text: str) -> list[str]:
    """Split a list of types at its commas, except those inside brackets."""
    found, depth = [""], 0
    for each in text:
        depth += (each in "([{<") - (each in ")]}>")
        if each == "," and depth == 0:
            found.append("")
        else:
            found[-1] += each
    return [each.strip() for each in found]


def kind_of(text: str) -> str:
    """Describe a type by its name in numba."""
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
    if found := re.match(r"(?:Int)?Enum class<\w+>?\((\w+)", text):
        return f"the enum {found[1]}"
    if found := re.match(r"Enum<\w+>?\((\w+)", text):
        return f"an enum {found[1]}"
    if found := re.match(r"IntEnum<\w+>?\((\w+)", text):
        return f"a {found[1]}"
    if re.match(r"(?:Uni)?Tuple\(", text):
        return "a list or tuple"
    if found := re.match(r"Object<(\w+)>", text):
        return f"a {found[1]}"
    if found := re.match(r"Unknown<(\w+)>", text):
        return f"a {found[1]} in an object"
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
