"""The gate: compiled code may refer to mathematics, to moving memory, and to log calls.

Whatever else it would need at run time is refused, with the line that it comes from.
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
    *(port_access.READ, port_access.READ_MORE),
}
_HEAP = {"aligned_alloc", "free"}
_MEANING = {
    "numba_gil_ensure": "the interpreter",
    "NRT_": "memory that grows",
    "numba_xx": "BLAS",
    "numba_ez": "LAPACK",
    "numba_raw": "LAPACK",
    "numba_": "functions that no loop has",
    "Py": "the interpreter",
    "_Py": "the interpreter",
    "printf": "printing",
    "puts": "printing",
}


def check(module: Any, compiled: Any, hooks: Any, realtime: bool) -> None:
    """Raise Mistake if a module refers to what it must not."""
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
    """Return the mistake of a hook that needs a function: at the call of NumPy that may be it."""
    needed = next((each for begin, each in _MEANING.items() if symbol.startswith(begin)), symbol)
    for file, line, text, name in compiled.other_calls:
        what = f"{name} is not compiled: it needs {needed}"
        return Mistake(file, line, what, "write it as arithmetic on elements", text)
    name = f"{compiled.description.name}.{'/'.join(hooks)}"
    what = f"{name} needs {needed}"
    return Mistake(compiled.file, compiled.line, what, "use arithmetic, NumPy on small arrays")


def _is_called(module: Any, name: str) -> bool:
    text = str(module)
    return text.count(f"@{name}(") + text.count(f'@"{name}"(') > 1
