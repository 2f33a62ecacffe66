"""The exceptions of compiled code, which numba stores in the code as pickled constants.

The runtime finds the exception and its line by a hash of these bytes; it does not unpickle them.
"""

import pickle
import re
from dataclasses import dataclass

from rtcf.component import Fault

from rtcf_compile.source.prefix_map import mapped

# Skip the hashes beside them (.sha1), which are arbitrary bytes.
_CONSTANT = re.compile(
    r'^@"?\.const\.pickledata\.[\d.]+"? = [^\n]*constant \[\d+ x i8\] c"([^"\n]*)"', re.M
)
# The first character of texts with two numbers: see raised_values.py.
WITH_VALUES = "\x1e"
_WORDS = {
    "division by zero": "division by zero",
    "Allocation failed (probably too large).": "the temporary arrays do not fit into the "
    "arena; make fewer of them in a loop",
}


@dataclass(frozen=True)
class Raise:
    """A statement that raises; line 0: in a function called from the line that the hook noted."""

    file: str
    line: int
    text: str
    has_values: bool = False  # the text has two {}


def raises_in(assembly: str, file: str) -> dict[int, Raise]:
    """Return the exceptions in the code of a module, by the hash of their bytes."""
    found = {}
    for constant in _CONSTANT.finditer(assembly):
        data = _bytes(constant[1])
        try:
            exception, arguments, place = pickle.loads(data)[:3]
        except (pickle.UnpicklingError, ValueError, TypeError, EOFError):
            continue  # numba's environment, not an exception
        text = str(arguments[0]) if arguments else ""
        has_values = text.startswith(WITH_VALUES)
        text = _WORDS.get(text, text.removeprefix(WITH_VALUES) if has_values else text)
        if exception is not Fault:
            text = f"{exception.__name__}: {text}" if text else exception.__name__
        there = place is not None and place[1] == mapped(file)
        found[hash_of(data)] = Raise(file, place[2] if there else 0, text, has_values)
    return found


def hash_of(data: bytes) -> int:
    """Return the 64-bit FNV-1a hash, as the runtime computes it."""
    value = 0xCBF29CE484222325
    for byte in data:
        value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return value


def _bytes(text: str) -> bytes:
    """Return the bytes of an LLVM string, which escapes backslashes and unprintable bytes."""
    plain = re.sub(
        r"\\(\\|[0-9A-Fa-f]{2})",
        lambda found: found[1] if found[1] == "\\" else chr(int(found[1], 16)),
        text,
    )
    return plain.encode("latin-1")
