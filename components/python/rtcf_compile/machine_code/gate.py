"""Checks the references of compiled code: mathematics, memory copies and log calls are allowed.

Other references are rejected, with the line that causes them.
"""

from typing import Any

from rtcf_compile.machine_code import port_access
from rtcf_compile.source.mistake import Mistake

_MATHEMATICS = [
    "acos",
    "acosh",
    "asin",
    "asinh",
    "atan",
    "atan2",
    "atanh",
    "cbrt",
    "ceil",
    "copysign",
    "cos",
    "cosh",
    "erf",
    "erfc",
    "exp",
    "exp2",
    "expm1",
    "fabs",
    "floor",
    "fma",
    "fmax",
    "fmin",
    "fmod",
    "hypot",
    "ldexp",
    "lgamma",
    "log",
    "log10",
    "log1p",
    "log2",
    "nearbyint",
    "nextafter",
    "pow",
    "remainder",
    "rint",
    "round",
    "sin",
    "sincos",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
    "tgamma",
    "trunc",
]
ALLOWED = {
    *_MATHEMATICS,
    *(f"{name}f" for name in _MATHEMATICS),
    *("memcpy", "memmove", "memset", "bcmp", "memcmp"),
    port_access.READ_MORE,
}
_HEAP = {"aligned_alloc", "free"}
_MEANING = {
    "numba_gil_ensure": "the interpreter",
    "NRT_": "memory that grows",
    "numba_xx": "BLAS",
    "numba_ez": "LAPACK",
    "numba_raw": "LAPACK",
    "numba_": "functions that the loop does not have",
    "Py": "the interpreter",
    "_Py": "the interpreter",
    "printf": "printing",
    "puts": "printing",
}


def check(module: Any, compiled: Any, hooks: Any, realtime: bool) -> None:
    """Raise Mistake if a module refers to a function that is not allowed."""
    allowed = ALLOWED if realtime else ALLOWED | _HEAP
    for function in module.functions:
        name = function.name
        if not function.is_declaration or name.startswith("llvm."):
            continue
        if name in allowed or name.startswith(f"rtcf_log_{compiled.description.name}_"):
            continue
        if not _is_called(module, name):
            continue
        raise _mistake(compiled, hooks, name)


def _mistake(compiled: Any, hooks: Any, symbol: str) -> Mistake:
    """Return the error of a hook that needs a function, at the NumPy call that may need it."""
    needed = next((each for begin, each in _MEANING.items() if symbol.startswith(begin)), symbol)
    for file, line, text, name in compiled.other_calls:
        what = f"{name} is not compiled: it needs {needed}"
        return Mistake(file, line, what, "write it as arithmetic on elements", text)
    name = f"{compiled.description.name}.{'/'.join(hooks)}"
    what = f"{name} needs {needed}"
    return Mistake(compiled.file, compiled.line, what, "use arithmetic and NumPy on small arrays")


def _is_called(module: Any, name: str) -> bool:
    text = str(module)
    return text.count(f"@{name}(") + text.count(f'@"{name}"(') > 1
